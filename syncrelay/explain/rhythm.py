"""The rhythm in which messages come: bursts after they were held up, and a pace that has slowed down."""

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import ceil, comb
from operator import sub
from statistics import median, median_low
from typing import Final, NamedTuple

LEAST_HELD_NS: Final = 500_000_000
AT_ONCE: Final = 3
"""So many come within one period: several messages at once, and not one that took longer."""


class Burst(NamedTuple):
    """The first of the messages that came at once: when it was received, and for how long it was held up."""

    at: int
    held: int


def bursts(arrivals: Sequence[tuple[int, int]]) -> Iterator[Burst]:
    """Yield the bursts among stamps and times of receipt, in nanoseconds, in the order of their receipt.

    Of arrivals that come in parts, each begins with the last AT_ONCE of the one before: so every burst is found once.
    """
    if len(arrivals) <= AT_ONCE:
        return
    usual = median_low([after - before for (before, _), (after, _) in pairwise(arrivals)])
    least = max(LEAST_HELD_NS, AT_ONCE * usual)
    for before, first, last in zip(arrivals, arrivals[1:], arrivals[AT_ONCE:], strict=False):
        held = (first[1] - first[0]) - (before[1] - before[0])
        if held >= least and first[0] > before[0] and last[1] - first[1] < usual:
            yield Burst(first[1], held)


_SECOND: Final = 1_000_000_000
# The current pace is the median of this many periods: neither a pause nor a burst changes it.
_PERIODS: Final = 20
_PACES: Final = 120
_FEWEST_PACES: Final = 6
# Until there are so many, a look may add several.
_SOON_PACES: Final = 12
# An input whose pace varies by more than this share of its median is not steady, so it cannot have slowed down ...
_STEADY: Final = 0.25
# ... without counting one poll in this many at either end, in which a busy machine held messages up.
_ODD: Final = 10
# That it has is seen of so many periods if so many of them are about as long, else of so many.
_LATEST: Final = 8
_LATEST_ALIKE: Final = 7
_LATEST_UNLIKE: Final = 12
# So few may show that it does.
_FEW: Final = 2
# It has slowed down below the first share of its steady pace, until it is above the second.
_SLOWED: Final = 0.7
RECOVERED: Final = 0.85


# A steady input: of this many last periods, most are about as long as their median, if there are half as many ...
_LAST_PERIODS: Final = 40
_ABOUT: Final = 0.25
# ... and hardly any is far longer. Otherwise messages come several at a time.
_FAR: Final = 4
_HARDLY: Final = 0.1
# Or most are near to whole multiples of the shortest, significantly often.
_MOSTLY: Final = 0.8
_BY_CHANCE: Final = 1e-4
# How near they are is known no better than this.
_NEAR: Final = 0.01
LEAST_PERIOD: Final = 1_000_000
"""Messages closer together than this, in nanoseconds, came at once."""


def steady_period(times: Sequence[int]) -> float | None:
    """Return the period of messages that come at a steady pace, but for pauses and what was lost; None of others.

    All times are in nanoseconds.
    """
    last = times[-_LAST_PERIODS - 1 :]
    periods = sorted(map(sub, last[1:], last))
    if not periods:
        return None
    usual = periods[len(periods) // 2]
    far = periods[round((1 - _HARDLY) * (len(periods) - 1))]
    if usual < LEAST_PERIOD or far > _FAR * usual:
        return None
    near = _about(usual, periods)
    if 2 * len(near) > len(periods) >= _LAST_PERIODS // 2:
        return sum(near) / len(near)
    # Where messages are lost at random, most periods are whole multiples of the shortest.
    short = periods[len(periods) // 4]
    if short < LEAST_PERIOD:
        return None
    near = _about(short, periods)
    base = sum(near) / len(near)
    off = sorted(abs(each / base - max(1, round(each / base))) for each in periods if each <= _FAR * base)
    most = ceil(_MOSTLY * len(periods))
    if most > len(off):
        return None
    # One of them is what the others are measured by.
    return base if chance(most - 1, len(periods) - 1, 2 * max(off[most - 1], _NEAR)) < _BY_CHANCE else None


def chance(least: int, of: int, share: float) -> float:
    """Return how likely it is that of so many, each of which is so likely, at least so many are."""
    if share >= 1:
        return 1.0
    return sum(comb(of, count) * share**count * (1 - share) ** (of - count) for count in range(least, of + 1))


def _about(period: float, periods: Sequence[int]) -> Sequence[int]:
    """Return which periods, sorted, are about as long."""
    return periods[bisect_left(periods, (1 - _ABOUT) * period) : bisect_right(periods, (1 + _ABOUT) * period)]


class PaceWatch:
    """The pace of one input, poll by poll. Remembers a steady one while the input is slower than that."""

    def __init__(self) -> None:
        self.now_hz = 0.0
        """The pace of the last messages, 0 of too few to tell."""
        self.slowed_from: float | None = None
        """The steady pace that it had before it slowed down, None if it has not."""
        self.may_be_slower = False
        """Whether the last few periods are alike, and so long that it has slowed down if they go on so."""
        self._paces: deque[float] = deque(maxlen=_PACES)
        # Of these, or faster than all.
        self._fastest = 0.0

    def forget(self) -> None:
        """Start afresh: others publish now."""
        self._paces.clear()
        self._fastest = 0.0
        self.slowed_from = None

    def observe(self, times: Sequence[int], fresh: int) -> None:
        """Take the stamps of the last messages, or when they were received, in nanoseconds; so many are new."""
        # Of an input that has just begun, what came since the last look may show several paces.
        parts = max(1, min(fresh // _LATEST, _SOON_PACES - len(self._paces)))
        for end in range(len(times) - _LATEST * (parts - 1), len(times) + 1, _LATEST):
            self._follow(times[max(0, end - _PERIODS - 1) : end])

    def _follow(self, last: Sequence[int]) -> None:
        self.may_be_slower = False
        # Stamps may begin anew, by another clock: who has slowed down has not recovered by that.
        if len(last) <= (_PERIODS if self.slowed_from is None else _LATEST):
            self.now_hz = 0.0 if self.slowed_from is None else self.now_hz
            return
        periods = list(map(sub, last[1:], last))
        self.now_hz = _pace_hz(periods)
        # A pace that falls is seen of the last few, if hardly any is as short as before: what is lost leaves some so.
        latest = periods[-_LATEST:]
        fell = self._fell_in(latest)
        if fell and len(_about(median_low(latest), sorted(latest))) < _LATEST_ALIKE:
            fell = self._fell_in(periods[-_LATEST_UNLIKE:])
        if self.slowed_from is None and fell:
            self.slowed_from, self.now_hz = fell, _pace_hz(latest)
        elif self.slowed_from is not None:
            self.now_hz = _pace_hz(latest)
            self.slowed_from = self.slowed_from if self.now_hz < RECOVERED * self.slowed_from else None
        if self.now_hz and self.slowed_from is None:
            few = sorted(periods[-_FEW:])
            if few[0] * self.now_hz * _SLOWED > _SECOND and len(_about(few[0], few)) == _FEW:
                self.may_be_slower = self._fell_from(_pace_hz(few), few[0]) is not None
            self._paces.append(self.now_hz)
            self._fastest = max(self._fastest, self.now_hz)

    def _fell_in(self, latest: Sequence[int]) -> float | None:
        return None if self.slowed_from else self._fell_from(_pace_hz(latest), sorted(latest)[1])

    def _fell_from(self, now_hz: float, short: int) -> float | None:
        if not now_hz or len(self._paces) < _FEWEST_PACES or now_hz >= _SLOWED * self._fastest:
            # As nearly always, and seen without looking at all of them.
            return None
        self._fastest = max(self._paces)
        usual = median(self._paces)
        odd = len(self._paces) // _ODD
        steady = sorted(self._paces)[odd : len(self._paces) - odd]
        if steady[-1] - steady[0] > 2 * _STEADY * usual or now_hz >= RECOVERED * steady[0]:
            return None
        return usual if now_hz < _SLOWED * usual and short * usual * _SLOWED > _SECOND else None


def _pace_hz(periods: Sequence[int]) -> float:
    period = median(periods)
    return _SECOND / period if period > 0 else 0.0
