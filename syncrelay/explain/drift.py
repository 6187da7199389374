"""Clock drift: how fast an input's stamps run against the time at which they are received."""

from collections.abc import Sequence
from math import sqrt
from statistics import fmean
from typing import NamedTuple

_FEWEST = 10


class Drift(NamedTuple):
    """A slope without unit, positive where stamps run slow, its standard error, and how long it was watched in ns."""

    slope: float
    error: float
    watched_ns: int


def drift(points: Sequence[tuple[int, int]]) -> Drift | None:
    """Return the drift from times of receipt and delays (time of receipt minus stamp), both in nanoseconds.

    By least squares; None from too few points to tell.
    """
    if len(points) < _FEWEST:
        return None
    # As differences of integers, before floats could lose the nanoseconds of an epoch.
    times = [time - points[0][0] for time, _ in points]
    delays = [delay - points[0][1] for _, delay in points]
    mean_time, mean_delay = fmean(times), fmean(delays)
    spread = sum((time - mean_time) ** 2 for time in times)
    if spread == 0:
        return None
    pairs = list(zip(times, delays, strict=True))
    slope = sum((time - mean_time) * (delay - mean_delay) for time, delay in pairs) / spread
    residuals = sum((delay - mean_delay - slope * (time - mean_time)) ** 2 for time, delay in pairs)
    return Drift(slope, sqrt(residuals / (len(points) - 2) / spread), times[-1])


def apart(one: Drift, other: Drift) -> Drift:
    """Return how fast two inputs drift apart."""
    watched = min(one.watched_ns, other.watched_ns)
    return Drift(one.slope - other.slope, sqrt(one.error**2 + other.error**2), watched)
