"""Whether a clock was set, by the least delay of each look: these lie on one level, and a step is another level.

The least delay of many messages hardly varies, so a step of a few milliseconds stands out of a jitter that is greater.
A delay may grow too: what is late from one message on comes after a gap, and what was late comes back to a level that
there was. A clock that is set leaves no gap, and a level below all others.
"""

from collections import deque
from collections.abc import Callable, Sequence
from itertools import pairwise
from statistics import median_low
from typing import Final, NamedTuple

from syncrelay.clock import Step

_SECOND: Final = 1_000_000_000
STEP_NS: Final = 500_000_000
"""Stamps of two clocks in turn are at least so far apart."""
# A message that was held up arrives late; setting a clock takes no time.
_SOON: Final = 0.5
_SOON_PERIODS: Final = 1.5
# Messages that were held up and then came at once have stamps a period apart.
_LAY_PERIODS: Final = 3
# Two clocks in turn: the step back is as large, and comes within this time.
_COMES_BACK: Final = 5 * _SECOND
_ALIKE: Final = 0.25
# Levels are those of so many looks, and known from so few: those of less lie in a wider range, by this many to as many.
_LEVELS: Final = 40
_FEWEST: Final = 3
_KNOWN_OF: Final = 12
# A minute of looks: messages that are late now may have been in time.
_REMEMBERED: Final = 60
# Another level is as far beyond the range of the levels as that is wide, and by this.
_LEAST: Final = 2_000_000
# It is one if so many looks agree; what so many do not agree on is no level.
_CONFIRMED: Final = 3
_GIVEN_UP: Final = 6
# A live clock is this close to the machine's before the step, or after it, and no farther than a day. A recording that
# is looped is not.
_LIVE: Final = 10 * _SECOND
_DAY: Final = 86_400 * _SECOND
_WINDOW: Final = 10 * _SECOND


class _Change(NamedTuple):
    """The two messages between which the delay changed most: when the later one came, and how long after the other."""

    at: int
    took: int


class StampSteps:
    """Watches one input's messages for steps."""

    def __init__(self) -> None:
        self._before: tuple[Sequence[int], Sequence[int]] = (), ()
        self._levels: deque[int] = deque(maxlen=_LEVELS)
        self._range: tuple[int, int] | None = None
        self._off: list[int] = []
        self._change = _Change(0, 0)
        self._swung: Step | None = None
        self._swings: deque[Step] = deque(maxlen=100)
        self._least: deque[int] = deque(maxlen=_REMEMBERED)
        self._nearest_to_none: int | None = None
        self.last: Step | None = None
        """The last step that stayed."""

    @property
    def least(self) -> int | None:
        """The least delay of the look at which it was nearest to none, in the last minute; None of a clock just set."""
        if self._nearest_to_none is None:
            self._nearest_to_none = min(self._least, key=abs, default=None)
        return self._nearest_to_none

    def _remember(self, least: int) -> None:
        known, oldest = self._nearest_to_none, self._least[0] if len(self._least) == _REMEMBERED else None
        if known is not None and (abs(least) < abs(known) or oldest == known):
            self._nearest_to_none = None
        self._least.append(least)

    def forget_clock(self) -> None:
        """Bear that stamps are of another clock from now on."""
        self._least.clear()
        self._nearest_to_none = None

    def forget(self) -> None:
        """Start afresh: this machine's clock was set."""
        self._before = (), ()
        self._swung = self.last = None
        self._swings.clear()
        self.forget_clock()
        self.forget_levels()

    def forget_levels(self) -> None:
        """Bear that messages take another time from now on."""
        self._levels.clear()
        self._range = None
        self._off.clear()

    @property
    def may_step(self) -> bool:
        """Whether the last messages lie on another level than those before, and it is not known yet if they stay."""
        return bool(self._off)

    def add(
        self, received: Sequence[int], delays: Sequence[int], least: int, most: int, *, period: Callable[[], float]
    ) -> int | None:
        """Take when messages came, their delays, and the least and the most of those.

        Return from when on stamps are of another level, where that is known now. `period` gives the usual time between
        two, when it is needed.
        """
        before, self._before = self._before, (received, delays)
        newest = before[1][-1] if before[1] else least
        if max(most, newest) - min(least, newest) >= STEP_NS:
            self._count_swings(_following(before, received, delays)[-len(delays) - 1 :], period())
        levels = self._levels
        self._remember(least)
        if len(levels) < _FEWEST:
            levels.append(least)
            return None
        low, high = self._range or (min(levels), max(levels))
        margin = (high - low) * max(1, _KNOWN_OF / len(levels)) + _LEAST
        side = (least > high + margin) - (least < low - margin)
        if not side or (self._off and (self._off[-1] > high) is not (side == 1)):
            self._off.clear()
            self._range = None
            if low <= least <= high and low < levels[0] < high:
                # As nearly always, and seen without looking at all of them.
                self._range = low, high
            levels.append(least)
            return None
        if not self._off:
            self._change = _most_changed(_following(before, received, delays), side)
        self._off.append(least)
        return self._concludes(side, margin, period) if len(self._off) >= _CONFIRMED else None

    def swings(self, now: int) -> tuple[int, int]:
        """Return how often stamps stepped there and back in the last 10 s, and by how much."""
        lately = [abs(step.by) for step in self._swings if 0 <= now - step.at < _WINDOW]
        return len(lately), median_low(lately) if lately else 0

    def _concludes(self, side: int, margin: float, period: Callable[[], float]) -> int | None:
        """Return when a clock was set, if what lies on another level does so because of that."""
        self._range = None
        latest = self._off[-_CONFIRMED:]
        level = median_low(latest)
        before = median_low(self._levels)
        by = before - level
        is_level = max(latest) - min(latest) <= max(_ALIKE * abs(by), margin)
        if not is_level and len(self._off) < _GIVEN_UP:
            return None
        if not is_level or (side == 1 and self._change.took > period() + abs(by) / 2):
            # They may be as late as that, and need not stay so.
            self._levels.extend(self._off)
            self._off.clear()
            return None
        # A look that held messages of before and after the step, or late ones, is of neither level.
        self._levels = deque(latest, _LEVELS)
        self._least, self._nearest_to_none = deque(latest, _REMEMBERED), None
        self._off.clear()
        if min(abs(level), abs(before)) < _LIVE and abs(by) < _DAY:
            self.last = Step(self._change.at, by)
        return self._change.at

    def _count_swings(self, messages: Sequence[tuple[int, int]], period: float) -> None:
        for (before, delay_before), (at, delay) in pairwise(messages):
            by, took = delay_before - delay, at - before
            if abs(by) < STEP_NS or took > max(_SOON * abs(by), _SOON_PERIODS * period):
                continue
            if by < 0 or by > _LAY_PERIODS * period:
                step, swung = Step(at, by), self._swung
                if swung is not None and at - swung.at < _COMES_BACK and _is_alike(-by, swung.by):
                    self._swings.append(step)
                self._swung = step


def _following(
    before: tuple[Sequence[int], Sequence[int]], received: Sequence[int], delays: Sequence[int]
) -> Sequence[tuple[int, int]]:
    """Return times of receipt and delays, after those of the look before."""
    return [*zip(*before, strict=True), *zip(received, delays, strict=True)]


def _most_changed(messages: Sequence[tuple[int, int]], side: int) -> _Change:
    one, other = max(pairwise(messages), key=lambda pair: side * (pair[1][1] - pair[0][1]), default=(messages[0],) * 2)
    return _Change(other[0], other[0] - one[0])


def _is_alike(one: int, other: int) -> bool:
    return abs(one - other) <= _ALIKE * abs(other)
