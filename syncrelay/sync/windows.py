"""How far the stamps of each input may be off, beside slop: which messages may be in one set."""

from collections.abc import Sequence
from typing import NamedTuple


class Window(NamedTuple):
    """How far before and after a stamp the moment of its message may be.

    Messages may be in one set if their windows share a moment. A window reaches as far as the input's tolerance, but no
    farther than half of slop, as it does where there is none. So without tolerances, the span of a set is at most slop;
    with them, two messages are at most both tolerances apart.
    """

    before: int
    after: int

    def around(self, stamp: int) -> tuple[int, int]:
        """Return the first and the last moment that a message of this stamp may be of."""
        return stamp - self.before, stamp + self.after


Tolerances = Sequence[int | None] | None
"""For each input how far its stamps may be off, None for half of slop; None alone for half of slop at all."""


def windows_of(slop_ns: int, tolerances_ns: Tolerances, n_inputs: int) -> list[Window]:
    """Return the window of each input. Raises ValueError for tolerances that cannot be."""
    tolerances = (None,) * n_inputs if tolerances_ns is None else tuple(tolerances_ns)
    if len(tolerances) != n_inputs or any(each is not None and each < 0 for each in tolerances):
        raise ValueError(f"tolerances_ns {tolerances} must be {n_inputs} numbers, 0 or more, or None")
    # Of an odd slop, the nanosecond that is left counts after the stamp.
    half = Window(slop_ns // 2, slop_ns - slop_ns // 2)
    return [half if each is None else Window(*(min(each, reach) for reach in half)) for each in tolerances]


def are_narrowed(windows: Sequence[Window], slop_ns: int) -> bool:
    """Whether more than slop says which messages may be in one set."""
    return any(before + after < slop_ns for before, after in windows)


def tolerances_of(tolerances_ns: Tolerances, required: Sequence[bool]) -> Tolerances:
    """Return the tolerances of the required inputs."""
    if tolerances_ns is None:
        return None
    return tuple(each for each, needed in zip(tolerances_ns, required, strict=True) if needed)
