"""What others map stamps with, each written down slowly: an average of the offset, Theil and Sen's line, a convex hull.

Each takes a stamp and a time of receipt, and returns the host's time of the stamp; all in nanoseconds. Each is told
that a clock was set where the offset is farther than half a second from before, which is more than they know at home.
"""

from collections.abc import Callable
from itertools import combinations
from statistics import median

from tests.clock.traces import SECOND

_FAR = SECOND // 2
_POINTS = 24

Mapping = Callable[[int, int], int]
_Points = list[tuple[int, int]]


def averaging() -> Mapping:
    """A moving average of the offset, as drivers have it."""
    offset: list[float] = []

    def mapped(stamp: int, received: int) -> int:
        apart = received - stamp
        if not offset or abs(apart - offset[0]) > _FAR:
            offset[:] = [apart]
        offset[0] += 0.02 * (apart - offset[0])
        return stamp + round(offset[0])

    return mapped


def theil_sen() -> Mapping:
    """The median of all slopes between points of the last minute, and of the offsets from that line."""
    return _of_points(_median_line)


def convex_hull() -> Mapping:
    """The edge of the lower convex hull of the last minute below its middle, without doubt of its slope."""
    return _of_points(_hull_line)


def _of_points(line: Callable[[_Points], tuple[float, float]]) -> Mapping:
    """A line through the quickest message of each of the last pieces of a minute, fitted as each piece ends."""
    points: _Points = []
    fitted = [0.0, 0.0]
    origin = [0, 0]
    since = [0]

    def mapped(stamp: int, received: int) -> int:
        apart = received - stamp
        if not points or abs(apart - origin[1] - fitted[0] - fitted[1] * (stamp - origin[0])) > _FAR:
            origin[:] = stamp, apart
            points[:] = [(0, 0)]
            fitted[:] = [0.0, 0.0]
            since[0] = received
        x, y = stamp - origin[0], apart - origin[1]
        if received - since[0] >= 60 * SECOND / _POINTS:
            since[0] = received
            del points[: len(points) - _POINTS]
            fitted[:] = line(points)
            points.append((x, y))
        elif y - fitted[1] * x < points[-1][1] - fitted[1] * points[-1][0]:
            points[-1] = x, y
        return stamp + origin[1] + round(fitted[0] + fitted[1] * x)

    return mapped


def _median_line(points: _Points) -> tuple[float, float]:
    slopes = [(y2 - y1) / (x2 - x1) for (x1, y1), (x2, y2) in combinations(points, 2) if x1 != x2]
    slope = median(slopes) if slopes else 0.0
    return median(y - slope * x for x, y in points), slope


def _hull_line(points: _Points) -> tuple[float, float]:
    middle = sum(x for x, _ in points) / len(points)
    below = [
        ((y2 - y1) / (x2 - x1), x1, y1)
        for (x1, y1), (x2, y2) in combinations(sorted(points), 2)
        if x1 <= middle <= x2 and x1 < x2
    ]
    # The edge is the line through two points on either side of the middle that is lowest there.
    slope, x, y = min(below, key=lambda each: each[2] + each[0] * (middle - each[1]), default=(0.0, *points[0]))
    return y - slope * x, slope
