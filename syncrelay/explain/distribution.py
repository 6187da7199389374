"""A sample of one quantity, to be asked for its quantiles."""

from bisect import bisect_right
from collections.abc import Iterable
from math import ceil
from typing import Final


class Distribution:
    """Values in nanoseconds, sorted. Quantiles are values that occurred: the least that so many do not exceed."""

    __slots__ = ("values",)

    def __init__(self, values: Iterable[int]) -> None:
        self.values = tuple(sorted(values))

    def __bool__(self) -> bool:
        return bool(self.values)

    def quantile(self, share: float) -> int:
        """Return the value that `share` of all, 0 to 1, do not exceed. Raises IndexError when there is none."""
        return self.values[max(0, ceil(share * len(self.values)) - 1)]

    def share_over(self, limit: int) -> float:
        """Return which share of all, 0 to 1, exceeds a limit; 0 when there is none."""
        return 1 - bisect_right(self.values, limit) / len(self.values) if self.values else 0.0


NOTHING: Final = Distribution(())
