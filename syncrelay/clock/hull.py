"""The lower hull of points whose noise is one-sided: which lines may lie under them, and how likely each is.

A delay is the least that there is plus a jitter that is hardly ever negative. So no point lies under the true line but
a few whose stamp was late, and what is nearest to it tells most (Olson, "A Passive Solution to the Sensor
Synchronization Problem", 2010). Of all lines with no other point below, the likeliest for jitter that is distributed
exponentially touches the hull under the mean of the points.
"""

from bisect import bisect_left
from collections.abc import Sequence
from math import exp
from typing import Final, TypeAlias

Point: TypeAlias = tuple[float, float, int]
"""A time, a delay, and how many messages it stands for; of these, it is the quickest."""

# Stamps may be late, too. A point says nothing of the line if it lies farther below the next one than so many times
# what the next ones are apart, which are so many.
_ALONE: Final = 4.0
_NEAR: Final = 30
OUTLIERS: Final = 0.05
"""At most so many of all points do."""


class Hull:
    """The lower hull of points, in the order of their times, that lie near a line of some rate."""

    __slots__ = ("_corners", "_count", "mean", "middle")

    def __init__(self, points: Sequence[Point], rate: float) -> None:
        """Take one point or more, and about how fast the delays grow."""
        heights = [y - rate * x for x, y, _ in points]
        ordered = sorted(heights)
        least = ordered[_first_of_many(ordered)]
        corners: list[tuple[float, float]] = []
        count, total_x, total_y = 0, 0.0, 0.0
        for (x, y, n), height in zip(points, heights, strict=True):
            if height < least:
                continue
            count, total_x, total_y = count + n, total_x + n * x, total_y + n * y
            while len(corners) > 1:
                (x1, y1), (x2, y2) = corners[-2], corners[-1]
                if (y2 - y1) * (x - x1) < (y - y1) * (x2 - x1):
                    # It lies below the line between its neighbours.
                    break
                corners.pop()
            corners.append((x, y))
        self._corners, self._count = corners, count
        self.mean = total_x / count
        """The mean of their times."""
        self.middle = total_y / count
        """The mean of their delays."""

    @property
    def count(self) -> int:
        """How many messages they stand for, without those that lie below all others."""
        return self._count

    def slope(self, x: float, beyond: float) -> float:
        """Return the slope of the edge at x; on the ends, `beyond`."""
        place = bisect_left(self._corners, (x,))
        if not 0 < place < len(self._corners):
            return beyond
        (x1, y1), (x2, y2) = self._corners[place - 1], self._corners[place]
        return (y2 - y1) / (x2 - x1)

    def level(self, rate: float) -> float:
        """Return the delay at 0 of the line of some rate that touches the hull."""
        return min([y - rate * x for x, y in self._corners])

    def height(self, rate: float) -> float:
        """Return how far points lie above that line on average."""
        return self.middle - rate * self.mean - self.level(rate)

    def bounds(self, rate: float, evidence: float, least: float) -> tuple[float, float]:
        """Return between which rates lie all those that are less than e^evidence times less likely than the likeliest.

        `least` is the jitter that there is in any case. By likelihood where the jitter is not known but from these
        points: of three of them nothing follows.
        """
        free = self._count - 2
        if free < 1 or len(self._corners) < 2:  # noqa: PLR2004  a line goes through two
            return float("-inf"), float("inf")
        highest = max(self.height(rate), least) * exp(min(evidence / free, 100.0)) - self.middle
        slopes = [((highest + y) / (x - self.mean), x > self.mean) for x, y in self._corners if x != self.mean]
        return (
            max([slope for slope, is_after in slopes if not is_after], default=float("-inf")),
            min([slope for slope, is_after in slopes if is_after], default=float("inf")),
        )


def _first_of_many(heights: list[float]) -> int:
    """Return which of these heights, sorted, is the least that others are near: less had a stamp that was late."""
    first = 0
    for place in range(int(OUTLIERS * len(heights))):
        if heights[place + 1] - heights[place] > _ALONE * _spacing(heights, place + 1):
            first = place + 1
    return first


def _spacing(heights: list[float], first: int) -> float:
    """Return how far apart the least heights are, from one of them on."""
    last = min(first + _NEAR, len(heights) - 1)
    return (heights[last] - heights[first]) / (last - first) if last > first else 0.0
