"""The drawing as SVG, in the light or dark of whoever looks at it."""

from collections.abc import Iterator
from html import escape
from typing import Final

from syncrelay.cli.graph.drawing import Drawing
from syncrelay.cli.graph.layout import LINE, MARGIN, PADDING, Layout, Line, Placed, layout_of
from syncrelay.config.wording import all_of

_STYLE: Final = """\
.syncrelay { --paper: #ffffff; --ink: #1f2328; --dim: #59636e; --topic: #f6f8fa; --group: #ddf4ff; --line: #818b98;
  --ok: #1a7f37; --warn: #9a6700; --error: #d1242f; --stale: #59636e;
  font: 13px ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace; }
@media (prefers-color-scheme: dark) { .syncrelay { --paper: #0d1117; --ink: #f0f6fc; --dim: #9198a1;
  --topic: #161b22; --group: #10233d; --line: #656c76; --ok: #3fb950; --warn: #d29922; --error: #f85149;
  --stale: #9198a1; } }
.syncrelay .paper { fill: var(--paper); }
.syncrelay text { fill: var(--dim); white-space: pre; }
.syncrelay .name { fill: var(--ink); font-weight: 600; }
.syncrelay .topic rect { fill: var(--topic); stroke: var(--line); }
.syncrelay .group rect { fill: var(--group); stroke: var(--line); stroke-width: 1.5; }
.syncrelay path { fill: none; stroke: var(--line); stroke-width: 1.5; }
.syncrelay .dashed { stroke-dasharray: 5 4; }
.syncrelay marker path { fill: var(--line); stroke: none; }
.syncrelay .label { font-size: 11px; stroke: var(--paper); stroke-width: 3; paint-order: stroke; }
.syncrelay .ok rect { stroke: var(--ok); }
.syncrelay .warn rect { stroke: var(--warn); stroke-width: 2.5; }
.syncrelay .error rect { stroke: var(--error); stroke-width: 2.5; }
.syncrelay .stale rect { stroke: var(--stale); stroke-dasharray: 4 3; }
.syncrelay .warn .found { fill: var(--warn); }
.syncrelay .error .found { fill: var(--error); }"""
_BEND: Final = 40.0


def as_svg(drawing: Drawing) -> str:
    """Return the text of an SVG file, which needs no other."""
    return "\n".join(_lines(drawing, layout_of(drawing)))


def _lines(drawing: Drawing, layout: Layout) -> Iterator[str]:
    width, height = round(layout.width), round(layout.height)
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="syncrelay" width="{width}" height="{height}"'
        f' viewBox="0 0 {width} {height}" role="img" aria-labelledby="syncrelay-title syncrelay-desc">'
    )
    yield f'<title id="syncrelay-title">{escape(drawing.title)}</title>'
    yield f'<desc id="syncrelay-desc">{escape(" ".join(_description(drawing)))}</desc>'
    yield f"<style>\n{_STYLE}\n</style>"
    yield (
        '<defs><marker id="syncrelay-end" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7"'
        ' orient="auto"><path d="M0 0 8 4 0 8z"/></marker></defs>'
    )
    yield f'<rect class="paper" width="{width}" height="{height}"/>'
    yield f'<text class="name" x="{MARGIN:g}" y="{MARGIN + PADDING:g}">{escape(drawing.title)}</text>'
    yield from map(_path, layout.lines)
    for kind, boxes in (("topic", layout.boxes), ("group", layout.groups)):
        for box in boxes:
            yield from _box(kind, box)
    yield from (_label(line) for line in layout.lines if line.label)
    yield "</svg>"


def _description(drawing: Drawing) -> Iterator[str]:
    for group in drawing.groups:
        box = group.box
        inputs = all_of(drawing.inputs[link.input].name for link in group.links)
        found = f" {box.finding}" if box.finding else ""
        yield (
            f"{box.name} ({', '.join(box.lines)}) matches {inputs}, and publishes"
            f" {all_of(output.name for output in group.outputs)}.{found}"
        )


def _path(line: Line) -> str:
    (x, y), (to_x, to_y) = line.start, line.end
    to_x -= line.level
    bend = max(_BEND, (to_x - x) / 2)
    dashed = ' class="dashed"' if line.is_dashed else ""
    return (
        f'<path{dashed} d="M{x:.1f} {y:.1f}C{x + bend:.1f} {y:.1f} {to_x - bend:.1f} {to_y:.1f} {to_x:.1f} {to_y:.1f}'
        f'H{line.end[0]:.1f}" marker-end="url(#syncrelay-end)"/>'
    )


def _box(kind: str, placed: Placed) -> Iterator[str]:
    x, y = placed.x + PADDING, placed.y + (placed.height - len(placed.lines) * LINE) / 2 + LINE * 0.72
    yield f'<g class="{kind} {placed.box.mark.value}">'
    corner = 12 if kind == "group" else 3
    yield (
        f'<rect x="{placed.x:.1f}" y="{placed.y:.1f}" width="{placed.width:.1f}" height="{placed.height:.1f}"'
        f' rx="{corner}"/>'
    )
    for index, text in enumerate(placed.lines):
        of = "name" if index < placed.names else "found" if index >= len(placed.lines) - placed.found else "told"
        yield f'<text class="{of}" x="{x:.1f}" y="{y + index * LINE:.1f}">{escape(text)}</text>'
    yield "</g>"


def _label(line: Line) -> str:
    x, y = line.end
    return f'<text class="label" text-anchor="end" x="{x - 12:.1f}" y="{y - 7:.1f}">{escape(line.label)}</text>'
