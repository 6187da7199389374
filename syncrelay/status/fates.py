"""How a matched message and each kind of drop is drawn: differently without colour, too."""

from dataclasses import dataclass
from typing import Final

from syncrelay.sync import DropReason

MATCHED: Final = "matched"
UNNEEDED: Final = "unneeded"


@dataclass(frozen=True, slots=True)
class Fate:
    """What became of a message. Its colour is the style sheet's `--NAME`."""

    name: str
    word: str
    character: str
    """How it is drawn on a terminal."""
    path: str
    """Its shape as an SVG path within 5 units of the origin."""
    is_filled: bool
    """Whether the shape is filled; else it is stroked."""


_DRAWN: Final = {
    DropReason.LATE: ("<", "M4-4.5L-4.5 0L4 4.5Z", True),
    DropReason.DUPLICATE: ("=", "M-4-2H4M-4 2H4", False),
    DropReason.OVERFLOW: ("!", "M-4.5-4H4.5L0 4.5Z", True),
    DropReason.SUPERSEDED: ("»", "M0-4.5L4.5 0L0 4.5L-4.5 0Z", False),
    DropReason.TOO_FAR: ("×", "M-3.5-3.5L3.5 3.5M-3.5 3.5L3.5-3.5", False),  # noqa: RUF001  the sign, a cross
    DropReason.EXPIRED: ("~", "M-4-4.5H4L-4 4.5H4Z", False),
    DropReason.TIME_JUMP: ("^", "M0-4L-4 0L0 4M4-4L0 0L4 4", False),
    DropReason.UNSTAMPED: ("0", "M-4 0A4 4 0 1 0 4 0A4 4 0 1 0-4 0M-3 3L3-3", False),
    DropReason.MALFORMED: ("?", "M-4-4H4V4H-4Z", True),
    DropReason.THINNED: ("-", "M-4-4H4V4H-4Z", False),
    DropReason.NO_TRANSFORM: ("/", "M-4 4.5L4-4.5M-4.5-1L0-4.5", False),
    DropReason.PAUSED: (":", "M-2-4.5V4.5M2-4.5V4.5", False),
    DropReason.SHUTDOWN: ("|", "M-4.5 0H4.5M0-4.5V4.5", False),
}

FATES: Final = (
    Fate(MATCHED, "in sets", "A", "M-4 0A4 4 0 1 0 4 0A4 4 0 1 0-4 0", is_filled=True),
    Fate(UNNEEDED, "not needed", "·", "M-1.5 0A1.5 1.5 0 1 0 1.5 0A1.5 1.5 0 1 0-1.5 0", is_filled=True),
    *(Fate(reason.value, reason.value, *drawn) for reason, drawn in _DRAWN.items()),
)
"""All fates, in the order of their codes."""

CODES: Final = {fate.name: code for code, fate in enumerate(FATES)}
