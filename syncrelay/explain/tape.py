"""What left all groups last, numbered, for those who tap the relay.

One record serves all of them, by the number that each has read to: what a tap costs the receive thread is the same for
one and for many, and one that stalls holds nothing.
"""

from collections import deque
from itertools import islice
from typing import Final, NamedTuple, TypeAlias

from syncrelay.config import GroupConfig
from syncrelay.explain.report import RecentDrop
from syncrelay.runtime import SYSTEM, Runtime

Stamps: TypeAlias = tuple[int | None, ...]
"""Stamps of a set in input order, in nanoseconds; None where a message was missing."""

KEPT: Final = 10_000
"""How many sets and drops of all groups are kept: those of some seconds at 1 kHz."""
UNHEARD_S: Final = 30.0
"""So long after it was last asked, a tap counts as gone."""
# How often the receive thread looks whether anyone still asks.
_LOOKS_EVERY: Final = 1024


class Left(NamedTuple):
    """A set, by its stamps, or a drop: when it left, and when its message, of a set the last one, was received.

    Times are nanoseconds of the system clock.
    """

    number: int
    group: GroupConfig
    outcome: Stamps | RecentDrop
    left: int
    received: int


class Tape:
    """Keeps what leaves while somebody reads it. `note` is the receive thread's; all else may be called on any."""

    def __init__(self, *, runtime: Runtime = SYSTEM) -> None:
        self.is_on = False
        """Whether anyone reads: whoever notes asks first."""
        self.last = 0
        """The number of what left last."""
        self._kept: deque[Left] = deque(maxlen=KEPT)
        self._monotonic = runtime.monotonic
        self._asked = 0.0

    def note(self, group: GroupConfig, outcome: Stamps | RecentDrop, left: int, received: int) -> None:
        """Keep what has just left, in place of the oldest."""
        self.last = number = self.last + 1
        self._kept.append(Left(number, group, outcome, left, received))
        if not number % _LOOKS_EVERY and self._monotonic() - self._asked > UNHEARD_S:
            self.is_on = False
            self._kept.clear()

    def listen(self) -> None:
        """Keep what leaves from now on, until nobody has called this for some time."""
        self._asked = self._monotonic()
        self.is_on = True

    def after(self, number: int, *, most: int) -> tuple[list[Left], int]:
        """Return what left after that number, the oldest first and so many at most, and how many were lost before."""
        newest = self._newest_since(number)
        lost = max(0, newest[-1].number - number - 1) if newest else 0
        return [each for each in reversed(newest) if each.number > number][:most], lost

    def _newest_since(self, number: int) -> list[Left]:
        """Return what left after that number, the newest first, and maybe some that left before."""
        while (count := self.last + 1 - number) > 1:
            # The list is filled in one call into C, but a message may be noted between the calls before that.
            try:
                newest = [*islice(reversed(self._kept), count)]
            except RuntimeError:
                continue
            if len(newest) < count or newest[-1].number <= number + 1:
                return newest
        return []
