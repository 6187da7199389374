"""How often a quantity fell below each of a few bounds, ever: what Prometheus calls a histogram."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import repeat
from typing import Final

BOUNDS_NS: Final = tuple(step * 10**power for power in range(5, 10) for step in (1, 2, 5))
"""0.1 ms to 5 s: from two stamps of one trigger to what no fusion can use."""


@dataclass(frozen=True, slots=True)
class Histogram:
    """`counts` of values in nanoseconds up to each of BOUNDS_NS, from the bound before; the last of those beyond."""

    counts: tuple[int, ...]
    sum: int


EMPTY: Final = Histogram((0,) * (len(BOUNDS_NS) + 1), 0)


class Tallied:
    """Counts values as they come."""

    def __init__(self) -> None:
        self._counts = [0] * (len(BOUNDS_NS) + 1)
        self._sum = 0

    def add(self, values: Sequence[int]) -> None:
        """Count values, in nanoseconds."""
        counts = self._counts
        for place in map(bisect_left, repeat(BOUNDS_NS), values):
            counts[place] += 1
        self._sum += sum(values)

    def histogram(self) -> Histogram:
        """Give all so far."""
        return Histogram(tuple(self._counts), self._sum)
