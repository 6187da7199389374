"""The drawing as Mermaid, which Markdown pages of GitHub, GitLab and others draw."""

import re
from collections.abc import Iterator
from typing import Final

from syncrelay.cli.graph.drawing import Box, Drawing, Link, Mark

# All else has a meaning somewhere in Mermaid's grammar, or in HTML.
_NOT_PLAIN: Final = re.compile(r"[^A-Za-z0-9 _./,:~+-]")
# A border is seen on both of GitHub's backgrounds; the colours of text and boxes are those of the page.
_STYLES: Final = {
    Mark.OK: "stroke:#2da44e,stroke-width:2px",
    Mark.WARN: "stroke:#bf8700,stroke-width:3px",
    Mark.ERROR: "stroke:#cf222e,stroke-width:3px",
    Mark.STALE: "stroke-dasharray:4 3",
}


def as_mermaid(drawing: Drawing) -> str:
    """Return the text of a Mermaid flowchart."""
    return "\n".join(_lines(drawing))


def _lines(drawing: Drawing) -> Iterator[str]:
    yield from ("---", f'title: "{_NOT_PLAIN.sub("?", drawing.title)}"', "---", "flowchart LR")
    marks: dict[str, Mark] = {}
    for index, each in enumerate(drawing.inputs):
        marks[f"i{index}"] = each.mark
        yield f'  i{index}["{_label(each)}"]'
    for at, group in enumerate(drawing.groups):
        marks[f"g{at}"] = group.box.mark
        yield f'  g{at}("{_label(group.box)}")'
        yield from (f"  i{link.input} {_arrow(link)} g{at}" for link in group.links)
        yield from (f'  g{at} --> o{at}_{index}["{_label(each)}"]' for index, each in enumerate(group.outputs))
    for mark, style in _STYLES.items():
        names = [name for name, its in marks.items() if its is mark]
        if names:
            yield f"  classDef {mark.value} {style}"
            yield f"  class {','.join(names)} {mark.value}"


def _arrow(link: Link) -> str:
    arrow = "-.->" if link.is_dashed else "-->"
    return f'{arrow}|"{_escaped(link.label)}"|' if link.label else arrow


def _label(box: Box) -> str:
    lines = [box.name, *box.lines, *([box.finding] if box.finding else [])]
    return "<br/>".join(map(_escaped, lines))


def _escaped(text: str) -> str:
    return _NOT_PLAIN.sub(lambda found: f"#{ord(found.group())};", text)
