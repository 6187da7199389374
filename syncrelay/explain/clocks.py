"""What stamps tell of a clock: how fast it runs against the time of receipt."""

from collections.abc import Sequence
from math import hypot, sqrt
from operator import mul, sub
from statistics import fmean, median
from typing import NamedTuple

_FEWEST = 5
_PARTS = 4
# A slope from few points may be off by more than its standard error says.
_MORE_OF_FEW = 8
# A point this many times as far off the line as the median point was held up on its way.
_HELD_UP = 6
_LEAST_HELD_UP = 1_000_000


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
