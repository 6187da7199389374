"""How fast a clock runs against the time of receipt, by the line under its delays."""

from collections.abc import Sequence
from math import hypot
from statistics import median
from typing import Final, NamedTuple, TypeVar

from syncrelay.clock.hull import Hull, Point

_T = TypeVar("_T")
_SECOND: Final = 1_000_000_000
_FEWEST: Final = 5
_PARTS: Final = 4
# So many points tell as much as more, of which they are the least, and are not misled by noise to both sides. Which
# of so many lie on a line is seen before that.
_JOINED: Final = 20
_SHOWN: Final = 60
# A point this many times as far above the line as the median point was held up on its way.
_HELD_UP: Final = 6
_LEAST_HELD_UP: Final = 0.001
# A slope may be any that is not e^3 times less likely than the likeliest, and is none that is e^16 times less likely:
# it is looked at every second, of each input of each relay.
_MAY_BE: Final = 3.0
_EVIDENT: Final = 16.0
# What takes less is below what systems tell of times.
_LEAST_JITTER: Final = 1e-9


class Drift(NamedTuple):
    """A slope without unit, positive where stamps run slow, and for how long it was watched in nanoseconds.

    `bend_ns` is how far the delays stray from the line, by the medians of the quarters of that time: a clock drifts
    along a line, what else makes delays grow, such as a load, a step or a pause, does not. The slope is likely within
    `error`, and for certain within `doubt`.
    """

    slope: float
    bend_ns: float
    watched_ns: int
    error: float = 0.0
    doubt: float = 0.0

    @property
    def drifted_ns(self) -> float:
        """How far stamps drifted while they were watched."""
        return self.slope * self.watched_ns


def drift(points: Sequence[tuple[int, int]]) -> Drift | None:
    """Return the drift from times of receipt and least delays (times of receipt minus stamps), both in nanoseconds.

    Without what was held up; None from too few points to tell.
    """
    if len(points) < _FEWEST or points[0][0] == points[-1][0]:
        return None
    watched = points[-1][0] - points[0][0]
    points = _least_of_parts([*points], [delay for _, delay in points], _SHOWN)
    # As differences of integers, before floats could lose the nanoseconds of an epoch.
    first_time, first_delay = points[0]
    near = [((time - first_time) / _SECOND, (delay - first_delay) / _SECOND, 1) for time, delay in points]
    slope, heights = _line(near, 0.0)
    far = max(_HELD_UP * median(heights), _LEAST_HELD_UP)
    if max(heights) > far:
        near = [point for point, height in zip(near, heights, strict=True) if height <= far]
        if len(near) < _FEWEST:
            return None
    hull = Hull(_joined(near, slope), slope)
    slope = hull.slope(hull.mean, slope)
    quarter = len(near) // _PARTS
    parts = [near[part * quarter : (part + 1) * quarter] for part in range(_PARTS)]
    medians = [median([y - slope * x for x, y, _ in part]) for part in parts]
    bend = (max(medians) - min(medians)) / 2 * _SECOND
    error, doubt = (_half(hull.bounds(slope, evidence, _LEAST_JITTER)) for evidence in (_MAY_BE, _EVIDENT))
    return Drift(slope, bend, watched, error, doubt)


def _joined(points: Sequence[Point], slope: float) -> Sequence[Point]:
    """Return of each few points the one that is nearest to a line below."""
    return _least_of_parts(points, [y - slope * x for x, y, _ in points], _JOINED)


def _least_of_parts(points: Sequence[_T], heights: Sequence[float], most: int) -> list[_T]:
    """Divide points into no more parts than so many, of as many each, and return the lowest point of each."""
    of = -(-len(points) // most)
    if of <= 1:
        return [*points]
    firsts = range(0, len(points), of)
    return [points[heights.index(min(heights[first : first + of]), first)] for first in firsts]


def _line(points: Sequence[Point], rate: float) -> tuple[float, list[float]]:
    """Return the slope of the likeliest line under points, and how far above it each of them is."""
    hull = Hull(points, rate)
    slope = hull.slope(hull.mean, rate)
    level = hull.level(slope)
    return slope, [y - slope * x - level for x, y, _ in points]


def _half(bounds: tuple[float, float]) -> float:
    return (bounds[1] - bounds[0]) / 2


def apart(one: Drift, other: Drift) -> Drift:
    """Return how fast two inputs drift apart."""
    return Drift(
        one.slope - other.slope,
        one.bend_ns + other.bend_ns,
        min(one.watched_ns, other.watched_ns),
        hypot(one.error, other.error),
        hypot(one.doubt, other.doubt),
    )
