"""Makes the sidebar of docs/index.md: its headings, and below each the pages that it links to, in that order.

So a page is listed once, in words that people read on a code host too.
"""  # noqa: INP001  no package

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from sphinx.application import Sphinx

_SECTION: Final = re.compile(r"^## (?P<title>.+)$(?P<text>(?:\n(?!## ).*)*)", re.MULTILINE)
_LINK: Final = re.compile(r"\]\(([\w/.-]+)\.md\)")


def _toctrees(index: str) -> Iterator[str]:
    """Return a directive for each section."""
    listed: set[str] = set()
    for section in _SECTION.finditer(index):
        pages = [page for page in dict.fromkeys(_LINK.findall(section["text"])) if page not in listed]
        listed.update(pages)
        if pages:
            names = "\n".join(pages)
            yield f"\n\n```{{toctree}}\n:hidden:\n:caption: {section['title']}\n\n{names}\n```\n"


def _read(app: Sphinx, document: str, content: list[str]) -> None:
    if document == app.config.root_doc:
        content[0] += "".join(_toctrees(Path(app.srcdir, f"{document}.md").read_text()))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.connect("source-read", _read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
