"""How fast an input comes, and how fast it used to: a sensor that has slowed down does not pass for well."""

from collections import deque
from collections.abc import Sequence
from operator import sub
from statistics import median
from typing import Final

_SECOND: Final = 1_000_000_000
# The median of so many periods is the pace of now: neither a pause nor a burst changes it.
_PERIODS: Final = 20
_LOOKS: Final = 120
_FEWEST_LOOKS: Final = 10
# What varies by more than this share of its median has no pace to fall from ...
_STEADY: Final = 0.25
# ... but for one look in so many at either end, in which a busy machine held messages up.
_ODD: Final = 10
# Slower than this share of its pace it has slowed down, until it is faster than the other.
_SLOWED: Final = 0.7
_RECOVERED: Final = 0.85


class Pace:
    """The pace of one input, look by look. Remembers a steady one while the input is slower than that."""

    def __init__(self) -> None:
        self.now_hz = 0.0
        """The pace of the last messages, 0 of too few to tell."""
        self.slowed_from: float | None = None
        """The steady pace that it had before it slowed down, None if it has not."""
        self._looks: deque[float] = deque(maxlen=_LOOKS)

    def look(self, received: Sequence[int]) -> None:
        """Take the times of receipt of the last messages, in nanoseconds."""
        last = received[-_PERIODS - 1 :]
        if len(last) <= _PERIODS:
            self.now_hz = 0.0
            self.slowed_from = None
            return
        period = median(map(sub, last[1:], last))
        self.now_hz = _SECOND / period if period > 0 else 0.0
        self.slowed_from = self._fell_from()
        if self.now_hz and self.slowed_from is None:
            self._looks.append(self.now_hz)

    def _fell_from(self) -> float | None:
        if not self.now_hz:
            return None
        if self.slowed_from is not None:
            return self.slowed_from if self.now_hz < _RECOVERED * self.slowed_from else None
        if len(self._looks) < _FEWEST_LOOKS or self.now_hz >= _SLOWED * max(self._looks):
            return None
        usual = median(self._looks)
        odd = len(self._looks) // _ODD
        steady = sorted(self._looks)[odd : len(self._looks) - odd]
        if steady[-1] - steady[0] > 2 * _STEADY * usual or self.now_hz >= _RECOVERED * steady[0]:
            return None
        return usual if self.now_hz < _SLOWED * usual else None
