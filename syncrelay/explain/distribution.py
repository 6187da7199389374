"""Samples of one quantity: the last values, their quantiles, and how often a value fell below a few bounds, ever."""

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import repeat
from math import ceil
from typing import Final

import numpy as np

_GREATEST: Final = (1 << 63) - 1


def no_values() -> "array[int]":
    """Make room for values in nanoseconds, oldest first."""
    # Beside one another in memory: each poll copies thousands, and touching every number on its own cost more than all
    # that is found out from them.
    return array("q")


def keep_last(values: "array[int]", newer: Sequence[int], most: int) -> None:
    """Append newer values and keep so many at most; what 64 bits do not hold is taken for the most that they do."""
    before = len(values)
    try:
        values.extend(newer)
    except OverflowError:
        del values[before:]
        values.extend([max(-_GREATEST, min(_GREATEST, value)) for value in newer])
    del values[:-most]


class Distribution:
    """Values in nanoseconds, oldest first. Quantiles are values that occurred: the least that so many do not exceed."""

    __slots__ = ("_sorted", "_values")

    def __init__(self, values: Sequence[int]) -> None:
        self._values = values
        self._sorted: tuple[int, ...] | None = None

    def __len__(self) -> int:
        return len(self._values)

    @property
    def values(self) -> tuple[int, ...]:
        """All values, sorted; only when it is asked for, which is not at every look."""
        if self._sorted is None:
            self._sorted = tuple(sorted(self._values))
        return self._sorted

    def newest(self, most: int) -> Sequence[int]:
        """Return the last values as they came, `most` at most, the newest first."""
        return self._values[: -most - 1 : -1]

    def quantile(self, share: float) -> int:
        """Return the value that `share` of all, 0 to 1, do not exceed. Raises IndexError when there is none."""
        place = max(0, ceil(share * len(self)) - 1)
        if isinstance(self._values, array) and self._values:
            # At a fifth of the cost of sorting them.
            values = np.array(self._values)
            values.partition(place)
            return int(values[place])
        return self.values[place]

    def share_over(self, limit: int) -> float:
        """Return which share of all, 0 to 1, exceeds a limit; 0 when there is none."""
        if not self or max(self._values) <= limit:
            # As nearly always, and seen without sorting.
            return 0.0
        return (len(self) - bisect_right(self.values, limit)) / len(self)


NOTHING: Final = Distribution(())


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
