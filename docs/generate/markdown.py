"""What texts of the program become on a page."""

import re
from pathlib import Path

_ROOT = Path(__file__).parents[2]
# Seen from the page, which stands in docs/reference.
_UP = "../../"
_OURS = re.compile(r"(?<![\w/(`])(?:docs|configs)/[\w/.-]+\.(?:md|xml|yaml)")
# What Markdown would read as its own.
_MARKS = re.compile(r"([*<\[\]]|(?<!\w)_)")


def linked(text: str) -> str:
    """Make links of the files of ours that a text names."""

    def link(match: re.Match[str]) -> str:
        path = match[0]
        target = f"../{path.removeprefix('docs/')}" if path.startswith("docs/") else f"{_UP}{path}"
        return f"[{path}]({target})" if (_ROOT / path).exists() else path

    return _OURS.sub(link, text)


def plain(text: str) -> str:
    """Return a text of which nothing is taken for Markdown."""
    return _MARKS.sub(r"\\\1", text)
