"""Clock drift: how fast an input's stamps run against the time at which they are received."""

from collections.abc import Sequence
from operator import mul, sub
from statistics import fmean, median
from typing import NamedTuple

_FEWEST = 6
_PARTS = 4


class Drift(NamedTuple):
    """A slope without unit, positive where stamps run slow, and for how long it was watched in nanoseconds.

    `bend_ns` is how far the delays strayed from the line, by the medians of the quarters of that time: a clock drifts
    along a line, what else makes delays grow, such as a load, a step or a pause, does not.
    """

    slope: float
    bend_ns: float
    watched_ns: int

    @property
    def drifted_ns(self) -> float:
        """How far stamps drifted while they were watched."""
        return self.slope * self.watched_ns


def drift(points: Sequence[tuple[int, int]]) -> Drift | None:
    """Return the drift from times of receipt and delays (time of receipt minus stamp), both in nanoseconds.

    By least squares; None from too few points to tell.
    """
    if len(points) < _FEWEST:
        return None
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
    return Drift(slope, bend, points[-1][0] - first_time)


def apart(one: Drift, other: Drift) -> Drift:
    """Return how fast two inputs drift apart."""
    return Drift(one.slope - other.slope, one.bend_ns + other.bend_ns, min(one.watched_ns, other.watched_ns))
