"""Takes what the pages link to outside docs/ into the site, as pages in docs/repository/, which git ignores.

A code host shows such links by itself. A site has no files but its own, and must not name a host: so a Markdown file
becomes a page, any other file a page with its text, and a folder a page that lists what is in it.
"""  # noqa: INP001  no package

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from pygments.lexers import get_lexer_for_filename
from pygments.util import ClassNotFound
from sphinx.application import Sphinx

_FOLDER: Final = "repository"
# A fenced block, whose links are none; or a link or a picture, up to its address, and the address.
_BLOCK_OR_LINK: Final = re.compile(r"^ *```.*?^ *```|(?P<shown>\]\()(?P<target>[^)\s]+)", re.DOTALL | re.MULTILINE)
# Nothing leads to them but the link that is followed, and what they say is searched for where it is explained.
_HEAD: Final = "---\norphan: true\nnosearch: true\n---\n"


class _Repository:
    def __init__(self, docs: Path) -> None:
        self._docs = docs
        self._root = docs.parent
        self._pages = docs / _FOLDER

    def linked(self, text: str, of: Path) -> Iterator[Path]:
        """Return the files and folders outside docs/ that a page links to."""
        for match in _BLOCK_OR_LINK.finditer(text):
            place = self._place(match, of)
            if place and not place.is_relative_to(self._docs):
                yield place

    def rewritten(self, text: str, *, of: Path, at: Path) -> str:
        """Return a page's text with links that work where the page stands in the site."""

        def link(match: re.Match[str]) -> str:
            place = self._place(match, of)
            if place is None:
                return match[0]
            found = place if place.is_relative_to(self._docs) else self.page_of(place)
            _, hash_sign, anchor = match["target"].partition("#")
            return f"{match['shown']}{os.path.relpath(found, at.parent)}{hash_sign}{anchor}"

        return _BLOCK_OR_LINK.sub(link, text)

    def page_of(self, place: Path) -> Path:
        """Return where the page of a file or folder outside docs/ stands."""
        path = self._pages / place.relative_to(self._root)
        if place.is_dir():
            return path / "index.md"
        return path if path.suffix == ".md" else path.with_name(f"{path.name}.md")

    def text_of(self, place: Path) -> str:
        """Return that page's text."""
        page = self.page_of(place)
        if place.is_dir():
            return f"{_HEAD}# `{place.relative_to(self._root)}/`\n\n{self._list_of(place)}\n"
        if place.suffix == ".md":
            return _HEAD + self.rewritten(place.read_text(), of=place, at=page)
        path = os.path.relpath(place, page.parent)
        return (
            f"{_HEAD}# `{place.relative_to(self._root)}`\n\n"
            f"```{{literalinclude}} {path}\n:language: {_language(place)}\n```\n"
        )

    def _list_of(self, folder: Path) -> str:
        page = self.page_of(folder)
        names = {
            file: f"- [`{file.name}`]({os.path.relpath(self.page_of(file), page.parent)})" for file in _files(folder)
        }
        folders = {each: f"- `{each.name}/`" for each in folder.iterdir() if each.is_dir() and _is_shown(each)}
        return "\n".join(line for _, line in sorted((names | folders).items()))

    def _place(self, match: re.Match[str], of: Path) -> Path | None:
        """Return the file or folder of ours that a link leads to; None where it leads elsewhere."""
        path = (match["target"] or "").partition("#")[0]
        if not path or "://" in path or path.startswith("mailto:"):
            return None
        place = Path(os.path.normpath(of.parent / path))
        return place if place.exists() and place.is_relative_to(self._root) else None

    def pages(self) -> dict[Path, str]:
        """Return the texts of all pages that the site needs."""
        waiting = [
            place
            for page in sorted(self._docs.rglob("*.md"))
            if not page.is_relative_to(self._pages)
            for place in self.linked(page.read_text(), page)
        ]
        texts: dict[Path, str] = {}
        while waiting:
            place = waiting.pop()
            page = self.page_of(place)
            if page in texts:
                continue
            texts[page] = self.text_of(place)
            if place.is_dir():
                waiting += _files(place)
            elif place.suffix == ".md":
                waiting += self.linked(place.read_text(), place)
        return texts

    def write(self) -> None:
        """Write them, and remove those that nothing links to any more."""
        texts = self.pages()
        for page in self._pages.rglob("*.md"):
            if page not in texts:
                page.unlink()
        for page, text in texts.items():
            page.parent.mkdir(parents=True, exist_ok=True)
            # What is not written anew is not read anew.
            if not page.exists() or page.read_text() != text:
                page.write_text(text)


def _files(folder: Path) -> list[Path]:
    return [each for each in sorted(folder.iterdir()) if each.is_file() and _is_shown(each)]


def _is_shown(place: Path) -> bool:
    return not place.name.startswith((".", "__pycache__")) and place.suffix not in (".so", ".png")


def _language(file: Path) -> str:
    try:
        return str(get_lexer_for_filename(file.name).aliases[0])
    except (ClassNotFound, IndexError):
        return "text"


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    repository = _Repository(Path(app.srcdir))
    app.connect("builder-inited", lambda _app: repository.write())

    def read(_app: Sphinx, document: str, content: list[str]) -> None:
        page = Path(app.srcdir) / f"{document}.md"
        if not document.startswith(f"{_FOLDER}/"):
            content[0] = repository.rewritten(content[0], of=page, at=page)

    app.connect("source-read", read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
