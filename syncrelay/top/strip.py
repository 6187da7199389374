"""A group's recent messages as lanes of text: a letter for each set, a mark for each dropped message."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from types import MappingProxyType
from typing import Final, NamedTuple, TypeAlias

from rich.text import Text

from syncrelay.explain import NO_SET_MISSED, RecentDrop, RecentSet
from syncrelay.status import fates
from syncrelay.status.fates import FATES
from syncrelay.sync.messages import DropReason

Outcome: TypeAlias = RecentSet | RecentDrop

# Columns for a set's letter and its span, where the scale may be chosen.
_COLUMNS_PER_SET = 6
_FINEST_NS = 1_000_000
# A strip of such columns is longer than stamps of one clock are apart.
_COARSEST_NS = 10_000_000_000

_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
# Middle tones of the 256-colour palette: black letters on them, and lines of them on light and dark grounds, are
# readable whatever the terminal's theme makes of `green`.
_COLOURS = tuple(f"color({number})" for number in (37, 71, 172, 133))


class Mark(NamedTuple):
    """The character of a dropped message, and its style."""

    character: str
    style: str


_CHARACTERS: Final = {fate.name: fate.character for fate in FATES}
UNNEEDED: Final = Mark(_CHARACTERS[fates.UNNEEDED], "dim")
MARKS: Final[Mapping[DropReason, Mark]] = MappingProxyType(
    {reason: Mark(_CHARACTERS[reason.value], "dim" if reason in NO_SET_MISSED else "bold red") for reason in DropReason}
)
"""The marks of needed messages. Reasons that cost sets stand out."""


def mark_of(drop: RecentDrop) -> Mark:
    """Return how a dropped message is drawn."""
    return UNNEEDED if drop.unneeded else MARKS[drop.reason]


def letter_style(number: int) -> str:
    """Return the style of a set's letter by the set's number."""
    return f"color(16) on {_COLOURS[number % len(_COLOURS)]}"


@dataclass(frozen=True, slots=True)
class Window:
    """Draws the newest stamp, `head`, in the last column and older ones to its left."""

    head: int
    width: int
    column_ns: int

    def column(self, stamp: int) -> int | None:
        """Return the column of a stamp, None if it is too old or newer than the head."""
        behind = self.head // self.column_ns - stamp // self.column_ns
        return self.width - 1 - behind if 0 <= behind < self.width else None


def window_of(recent: Sequence[Outcome], width: int) -> Window:
    """Return a window in which each set has enough columns, or which holds all messages if there are no sets."""
    head = newest_stamp(recent)
    ends = sorted(max(_stamps(outcome)) for outcome in recent if isinstance(outcome, RecentSet))
    if len(ends) > 1:
        wanted = median(after - before for before, after in pairwise(ends)) / _COLUMNS_PER_SET
    else:
        oldest = min((stamp for outcome in recent for stamp in _stamps(outcome)), default=head)
        wanted = (head - oldest) / width
    return Window(head, width, _round_step(min(wanted, _COARSEST_NS)))


def _round_step(wanted: float) -> int:
    """Round up to 1, 2 or 5 times a power of ten milliseconds."""
    decade = _FINEST_NS
    while True:
        for step in (decade, 2 * decade, 5 * decade):
            if step >= wanted:
                return step
        decade *= 10


def newest_stamp(recent: Iterable[Outcome]) -> int:
    """Return the newest stamp in nanoseconds, 0 if there is none."""
    return max((stamp for outcome in recent for stamp in _stamps(outcome)), default=0)


def _stamps(outcome: Outcome) -> Iterator[int]:
    if isinstance(outcome, RecentDrop):
        yield outcome.stamp
    else:
        yield from (stamp for stamp in outcome.stamps if stamp is not None)


def strip(recent: Sequence[Outcome], window: Window, *, n_inputs: int, sets: int) -> list[Text]:
    """Draw two lines for each input: its lane, and below it the lines that join sets.

    The last line has the spans of the sets in milliseconds. `sets` is how many the group gave since its start: a set
    keeps its letter from frame to frame.
    """
    drawing = _Drawing(lanes=n_inputs, width=window.width)
    for outcome in recent:
        if isinstance(outcome, RecentDrop):
            _draw_drop(drawing, outcome, window)
    shown = [outcome for outcome in recent if isinstance(outcome, RecentSet)]
    for number, a_set in enumerate(shown, start=sets - len(shown)):
        _draw_set(drawing, number, a_set, window)
    return drawing.lines()


def _draw_drop(drawing: "_Drawing", drop: RecentDrop, window: Window) -> None:
    column, mark = window.column(drop.stamp), mark_of(drop)
    # In a column that several share, a needed message must be seen.
    if column is None or (mark is UNNEEDED and drawing.taken(2 * drop.input, column)):
        return
    drawing.put(2 * drop.input, column, *mark)


def _draw_set(drawing: "_Drawing", number: int, a_set: RecentSet, window: Window) -> None:
    colour = _COLOURS[number % len(_COLOURS)]
    columns = [None if stamp is None else window.column(stamp) for stamp in a_set.stamps]
    for lane, column in enumerate(columns):
        if column is not None:
            drawing.put(2 * lane, column, _LETTERS[number % len(_LETTERS)], letter_style(number))
    for lane, (above, below) in enumerate(pairwise(columns)):
        if above is not None and below is not None:
            _draw_joint(drawing, 2 * lane + 1, above, below, colour)
    last = next((column for column in reversed(columns) if column is not None), None)
    if last is not None:
        stamps = [stamp for stamp in a_set.stamps if stamp is not None]
        drawing.label(last, f"{(max(stamps) - min(stamps)) / 1e6:.1f}")


def _draw_joint(drawing: "_Drawing", line: int, above: int, below: int, style: str) -> None:
    if above == below:
        drawing.put(line, above, "│", style)
    else:
        falls = above < below
        drawing.put(line, above, "╰" if falls else "╯", style)
        for column in range(min(above, below) + 1, max(above, below)):
            drawing.put(line, column, "─", style)
        drawing.put(line, below, "╮" if falls else "╭", style)


class _Drawing:
    """Cells of a character and a style: a line for each lane, one below each, the last for labels."""

    def __init__(self, *, lanes: int, width: int) -> None:
        self.width = width
        self._cells = [[(" ", "")] * width for _ in range(2 * lanes)]

    def taken(self, line: int, column: int) -> bool:
        return self._cells[line][column][0] != " "

    def put(self, line: int, column: int, character: str, style: str) -> None:
        self._cells[line][column] = (character, style)

    def label(self, column: int, text: str) -> None:
        """Write a label below the lanes, centred on a column, unless it would touch another one."""
        line = len(self._cells) - 1
        begin = min(max(0, column - (len(text) - 1) // 2), self.width - len(text))
        if any(self.taken(line, near) for near in range(max(0, begin - 1), min(self.width, begin + len(text) + 1))):
            return
        for place, character in enumerate(text, start=begin):
            self.put(line, place, character, "")

    def lines(self) -> list[Text]:
        return [Text.assemble(*_joined(cells), no_wrap=True) for cells in self._cells]


def _joined(cells: Sequence[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Join neighbours of one style, so that rich need not handle each cell."""
    text, style = "", ""
    for character, cell_style in cells:
        if cell_style != style:
            yield text, style
            text, style = "", cell_style
        text += character
    yield text, style
