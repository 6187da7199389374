"""Draws the Mermaid of `syncrelay graph` with syncrelay's own SVG: a site must not ask another for Mermaid's program.

A code host draws it by itself. Any other Mermaid is shown as it is written.
"""  # noqa: INP001  no package

import html
import re
from typing import Any, Final

from docutils import nodes
from sphinx.application import Sphinx

from syncrelay.cli.graph.drawing import Box, Drawing, GroupBox, Link
from syncrelay.cli.graph.svg import as_svg

_TITLE: Final = re.compile(r'^---\ntitle: "(.*)"\n---\nflowchart LR\n')
_INPUT: Final = re.compile(r'^  i(\d+)\["(.*)"\]$')
_GROUP: Final = re.compile(r'^  g(\d+)\("(.*)"\)$')
_LINK: Final = re.compile(r'^  i(\d+) (-->|-\.->)(?:\|"(.*)"\|)? g(\d+)$')
_OUTPUT: Final = re.compile(r'^  g(\d+) --> o\d+_\d+\["(.*)"\]$')


def _box(label: str) -> Box:
    name, *lines = (re.sub(r"#(\d+);", lambda found: chr(int(found[1])), line) for line in label.split("<br/>"))
    return Box(name, tuple(lines))


def _drawing(text: str) -> Drawing | None:
    """Read what `syncrelay.cli.graph.mermaid` writes; None of anything else."""
    title = _TITLE.match(text)
    if title is None:
        return None
    inputs: list[Box] = []
    groups: list[tuple[Box, list[Link], list[Box]]] = []
    for line in text[title.end() :].splitlines():
        if found := _INPUT.match(line):
            inputs.append(_box(found[2]))
        elif found := _GROUP.match(line):
            groups.append((_box(found[2]), [], []))
        elif found := _LINK.match(line):
            groups[int(found[4])][1].append(Link(int(found[1]), found[3] or "", found[2] != "-->"))
        elif found := _OUTPUT.match(line):
            groups[int(found[1])][2].append(_box(found[2]))
        else:
            return None
    return Drawing(
        title=title[1],
        inputs=tuple(inputs),
        groups=tuple(GroupBox(box, tuple(links), tuple(outputs)) for box, links, outputs in groups),
    )


def _draw(_app: Sphinx, page: nodes.document) -> None:
    for block in list(page.findall(nodes.literal_block)):
        drawing = _drawing(block.astext()) if block.get("language") == "mermaid" else None
        if drawing is not None:
            svg = f'<div class="drawing" title="{html.escape(drawing.title)}">{as_svg(drawing)}</div>'
            block.replace_self(nodes.raw("", svg, format="html"))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.connect("doctree-read", _draw)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
