"""Faults in the order of an input's stamps: what repeats the newest, what is older, and stamps that fell back."""

from collections import deque
from collections.abc import Sequence
from operator import lt
from typing import Final, NamedTuple

from syncrelay.sync.arrivals import JUMP_NS

WINDOW_NS: Final = 10_000_000_000
"""Rates, drops and faults are those of about this long."""


class Faults(NamedTuple):
    """What was wrong with the stamps of messages that came together, the last of them at `at`.

    `falls` counts those below the one before them: stamps that were set back fall once, and are older for a while.
    """

    at: int
    duplicates: int = 0
    out_of_order: int = 0
    falls: int = 0


class Fall(NamedTuple):
    """Stamps fell by more than a second: by how much, and when that was received."""

    by: int
    at: int


class StampOrder:
    """Watches the stamps of one input as they come."""

    def __init__(self) -> None:
        self.fell: Fall | None = None
        """The last fall."""
        self._faults: deque[Faults] = deque()
        self._newest: int | None = None
        self._last: int | None = None
        self._fell_from: int | None = None

    def forget(self) -> None:
        """Forget the faults so far: this machine's clock was set, so the times at which they came mean nothing."""
        self._faults.clear()

    def lately(self, now: int) -> Sequence[Faults]:
        """Return what was wrong in the window, where something was."""
        return [each for each in self._faults if each.at > now - WINDOW_NS]

    def add(self, stamps: Sequence[int], received: Sequence[int]) -> bool:
        """Take stamps and when they were received; whether one fell by more than a second."""
        before = self.fell
        while self._faults and self._faults[0].at <= received[-1] - WINDOW_NS:
            self._faults.popleft()
        faults = self._judged(stamps, received)
        if faults.duplicates or faults.out_of_order:
            self._faults.append(faults)
        return self.fell is not before

    def _judged(self, stamps: Sequence[int], received: Sequence[int]) -> Faults:
        newest, before, self._last = self._newest, self._last, stamps[-1]
        if self._fell_from is None and newest is not None and newest < stamps[0] and all(map(lt, stamps, stamps[1:])):
            # Each newer than the one before it, as nearly always: seen at a fifth of the cost.
            self._newest = stamps[-1]
            return Faults(received[-1])
        duplicates = out_of_order = falls = 0
        for stamp, at in zip(stamps, received, strict=True):
            if self._is_late_no_more(stamp, at):
                out_of_order, falls = out_of_order + 1, falls + 1
            if newest is None or stamp > newest:
                newest = stamp
            elif not stamp:
                continue
            elif stamp == newest:
                duplicates += 1
            elif stamp < newest - JUMP_NS:
                self.fell = Fall(newest - stamp, at)
                self._fell_from = newest if self.fell.by < WINDOW_NS else None
                newest = stamp
            else:
                out_of_order += 1
                falls += before is not None and stamp < before
            before = stamp
        self._newest = newest
        return Faults(received[-1], duplicates, out_of_order, falls)

    def _is_late_no_more(self, stamp: int, at: int) -> bool:
        """Whether stamps that fell are back: a clock that was set takes as long as it fell, what came late does not."""
        if self._fell_from is None or self.fell is None:
            return False
        may_be_late = at - self.fell.at < self.fell.by
        if stamp > self._fell_from or not may_be_late:
            self._fell_from = None
        return may_be_late and self._fell_from is None
