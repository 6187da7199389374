"""What stamps tell of a clock: how fast it runs against the time of receipt, and whether it was set."""

from collections import deque
from collections.abc import Callable, Sequence
from itertools import islice
from math import hypot, sqrt
from operator import mul, sub
from statistics import fmean, median, median_low
from typing import Final, NamedTuple

from syncrelay.clock import Step

_FEWEST = 5
_PARTS = 4
# A slope from few points may be off by more than its standard error says.
_MORE_OF_FEW = 8
# A point this many times as far off the line as the median point was held up on its way.
_HELD_UP = 6
_LEAST_HELD_UP = 1_000_000
_SECOND: Final = 1_000_000_000


class Drift(NamedTuple):
    """A slope without unit, positive where stamps run slow, and for how long it was watched in nanoseconds.

    `bend_ns` is how far the delays strayed from the line, by the medians of the quarters of that time: a clock drifts
    along a line, what else makes delays grow, such as a load, a step or a pause, does not. `error` is that of the
    slope, by how far single points are off the line: that of jitter is as great as its slope. `points` is how many
    there were: a few of them lie on some line by chance.
    """

    slope: float
    bend_ns: float
    watched_ns: int
    error: float = 0.0
    points: int = 60

    @property
    def drifted_ns(self) -> float:
        """How far stamps drifted while they were watched."""
        return self.slope * self.watched_ns


def drift(points: Sequence[tuple[int, int]]) -> Drift | None:
    """Return the drift from times of receipt and delays (time of receipt minus stamp), both in nanoseconds.

    By least squares, without what was held up; None from too few points to tell.
    """
    if len(points) < _FEWEST:
        return None
    fit = _fit(points)
    if fit is None:
        return None
    found, strayed = fit
    if max(strayed) < _LEAST_HELD_UP:
        return found
    far = _HELD_UP * median(map(abs, strayed))
    if max(strayed) > far:
        near = [point for point, off in zip(points, strayed, strict=True) if abs(off) <= far]
        if len(near) >= _FEWEST and (fit := _fit(near)) is not None:
            return fit[0]
    return found


def _fit(points: Sequence[tuple[int, int]]) -> tuple[Drift, Sequence[float]] | None:
    """Return the line through points, and how far each is off it; None where all are of one moment."""
    # As differences of integers, before floats could lose the nanoseconds of an epoch.
    first_time, first_delay = points[0]
    times = [float(time - first_time) for time, _ in points]
    delays = [float(delay - first_delay) for _, delay in points]
    mean_time, mean_delay = fmean(times), fmean(delays)
    times = [time - mean_time for time in times]
    spread = sum(map(mul, times, times))
    if spread == 0:
        return None
    slope = sum(map(mul, times, delays)) / spread
    strayed = list(map(sub, delays, [mean_delay + slope * time for time in times]))
    quarter = len(points) // _PARTS
    bend = max(abs(median(strayed[part * quarter : (part + 1) * quarter])) for part in range(_PARTS))
    variance = sum(map(mul, strayed, strayed)) / (len(points) - 2)
    error = (1 + _MORE_OF_FEW / len(points)) * sqrt(variance / spread)
    return Drift(slope, bend, points[-1][0] - first_time, error, len(points)), strayed


def apart(one: Drift, other: Drift) -> Drift:
    """Return how fast two inputs drift apart."""
    watched = min(one.watched_ns, other.watched_ns)
    error, points = hypot(one.error, other.error), min(one.points, other.points)
    return Drift(one.slope - other.slope, one.bend_ns + other.bend_ns, watched, error, points)


STEP_NS: Final = 500_000_000
"""What is less may be a delay."""
# A message that was held up arrives late; setting a clock takes no time.
_SOON: Final = 0.5
_SOON_PERIODS: Final = 1.5
# Messages that were held up and then came at once have stamps a period apart.
_LAY_PERIODS: Final = 3
# Two clocks in turn: the step back is as large, and comes within this time.
_COMES_BACK: Final = 5 * _SECOND
_ALIKE: Final = 0.25
# A step is lasting if the delays of this many polls confirm it.
_LEVELS: Final = 3
# Late messages that are in time again have the delay of before: that of the polls of the last minute.
_USUAL: Final = 60
# A live clock is this close to the machine's after the step. A looped recording is not.
_LIVE: Final = 10 * _SECOND
_WINDOW: Final = 10 * _SECOND
_TOLD: Final = 30 * _SECOND


class StampSteps:
    """Watches one input's messages for steps."""

    def __init__(self) -> None:
        self._newest: tuple[int, int] | None = None
        self._pending: tuple[Step, int] | None = None
        self._levels: list[int] = []
        self._usual: deque[int] = deque(maxlen=_USUAL)
        self._stayed: Step | None = None
        self._swings: deque[Step] = deque(maxlen=100)

    def forget(self) -> None:
        """Start afresh: this machine's clock was set."""
        self._newest = self._pending = self._stayed = None
        self._swings.clear()
        self._usual.clear()

    def add(
        self, received: Sequence[int], delays: Sequence[int], least: int, most: int, *, period: Callable[[], float]
    ) -> None:
        """Take when messages came, their delays, and the least and the most of those.

        `period` gives the usual time between two, when it is needed.
        """
        newest, self._newest = self._newest, (received[-1], delays[-1])
        if newest is not None and max(most, newest[1]) - min(least, newest[1]) >= STEP_NS:
            self._scan(newest, received, delays, period())
        self._usual.append(least)
        if self._pending is not None:
            self._levels.append(least)
            if len(self._levels) > _LEVELS:
                self._conclude()

    def last(self, now: int) -> Step | None:
        """Return the last step that stayed, for half a minute."""
        step = self._stayed
        return step if step is not None and 0 <= now - step.at < _TOLD else None

    def swings(self, now: int) -> tuple[int, int]:
        """Return how often stamps stepped there and back in the last 10 s, and by how much."""
        lately = [abs(step.by) for step in self._swings if 0 <= now - step.at < _WINDOW]
        return len(lately), median_low(lately) if lately else 0

    def _scan(self, newest: tuple[int, int], received: Sequence[int], delays: Sequence[int], period: float) -> None:
        before, delay_before = newest
        for at, delay in zip(received, delays, strict=True):
            by, took = delay_before - delay, at - before
            before, delay_before = at, delay
            if abs(by) < STEP_NS or took > max(_SOON * abs(by), _SOON_PERIODS * period):
                continue
            if by < 0 or by > _LAY_PERIODS * period:
                self._note(Step(at, by), delay)

    def _note(self, step: Step, delay: int) -> None:
        if self._pending is not None:
            before = self._pending[0]
            if step.at - before.at < _COMES_BACK and _is_alike(-step.by, before.by):
                self._swings.append(step)
        self._pending = step, delay
        self._levels.clear()

    def _conclude(self) -> None:
        if self._pending is None:
            return
        (step, delay), self._pending = self._pending, None
        # What came with the step is of before it too.
        level = median_low(self._levels[1:])
        if abs(level) < _LIVE and _is_alike(level - delay - step.by, -step.by) and not self._is_back(step, level):
            self._stayed = step

    def _is_back(self, step: Step, level: int) -> bool:
        """Whether messages that were late, though no clock had been set, come as they did before."""
        was_set = self._stayed is not None and _is_alike(-step.by, self._stayed.by)
        earlier = islice(self._usual, max(0, len(self._usual) - len(self._levels)))
        return step.by > 0 and not was_set and any(abs(each - level) <= _ALIKE * step.by for each in earlier)


def _is_alike(one: int, other: int) -> bool:
    return abs(one - other) <= _ALIKE * abs(other)
