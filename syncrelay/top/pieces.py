"""Small pieces of the screen, as rich text: sparklines, bars, lines that fit."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from textwrap import wrap
from typing import Final

from rich.text import Text

from syncrelay.status import Level

_HEIGHTS: Final = "▁▂▃▄▅▆▇█"
STYLES: Final[Mapping[Level, str]] = {
    Level.OK: "green",
    Level.WARN: "bold yellow",
    Level.ERROR: "bold red",
    Level.STALE: "bold magenta",
}


def sparkline(values: Sequence[float], width: int) -> str:
    """Draw each of the last values as a bar from 0 to the largest of them, padded to the width."""
    shown = values[-width:]
    top = max(shown, default=0)
    heights = (round(max(0.0, value / top) * (len(_HEIGHTS) - 1)) if top > 0 else 0 for value in shown)
    return "".join(_HEIGHTS[height] for height in heights).ljust(width)


def bar(share: float, width: int) -> Text:
    """Draw a share of 1, readable without colour."""
    filled = round(share * width)
    return Text.assemble(("━" * filled, "bold"), ("╌" * (width - filled), "dim"))


def line(*parts: str | Text | tuple[str, str]) -> Text:
    """Join texts, and pairs of a text and its style, to one line."""
    return Text.assemble(*parts, no_wrap=True, overflow="ellipsis")


def wrapped(text: str, width: int, *, first: Text, style: str = "") -> Iterator[Text]:
    """Wrap a text behind `first`, and indent the further lines by its width."""
    indent = first.cell_len
    for number, words in enumerate(wrap(text, max(10, width - indent), break_on_hyphens=False)):
        yield line(first if number == 0 else " " * indent, (words, style))


def screenful(lines: Iterable[Text], width: int) -> Text:
    """Join lines, each cut to the width."""
    cut = []
    for each in lines:
        each.truncate(width, overflow="ellipsis")
        cut.append(each)
    return Text("\n", no_wrap=True).join(cut)
