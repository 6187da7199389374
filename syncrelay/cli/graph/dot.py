"""The drawing as DOT, which Graphviz draws."""

from collections.abc import Iterator
from typing import Final

from syncrelay.cli.graph.drawing import Box, Drawing, Link, Mark
from syncrelay.cli.graph.layout import broken

_COLOURS: Final = {Mark.OK: "#2da44e", Mark.WARN: "#bf8700", Mark.ERROR: "#cf222e", Mark.STALE: "#818b98"}


def as_dot(drawing: Drawing) -> str:
    """Return the text of a DOT digraph."""
    return "\n".join(_lines(drawing))


def _lines(drawing: Drawing) -> Iterator[str]:
    yield f"digraph {_quoted(drawing.title)} {{"
    yield "  graph [rankdir=LR];"
    yield '  node [shape=box, fontname="monospace", fontsize=10];'
    yield '  edge [fontname="monospace", fontsize=9];'
    yield from (f"  i{index} [{_attributes(each)}];" for index, each in enumerate(drawing.inputs))
    for at, group in enumerate(drawing.groups):
        yield f"  g{at} [style=rounded, {_attributes(group.box)}];"
        yield from (f"  i{link.input} -> g{at}{_line(link)};" for link in group.links)
        for index, output in enumerate(group.outputs):
            yield f"  o{at}_{index} [{_attributes(output)}];"
            yield f"  g{at} -> o{at}_{index};"
    yield "}"


def _attributes(box: Box) -> str:
    label = f"label={_quoted(box.name, *box.lines, *(broken(box.finding) if box.finding else []))}"
    colour = _COLOURS.get(box.mark)
    return f'{label}, color="{colour}", penwidth=2' if colour else label


def _line(link: Link) -> str:
    told = [f"label={_quoted(link.label)}"] if link.label else []
    told += ["style=dashed"] if link.is_dashed else []
    return f" [{', '.join(told)}]" if told else ""


def _quoted(*lines: str) -> str:
    # Graphviz reads entities of HTML in every text.
    escaped = (each.replace("&", "&amp;").replace("\\", "\\\\").replace('"', '\\"') for each in lines)
    return '"' + "\\n".join(escaped) + '"'
