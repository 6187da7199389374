"""A sample of one quantity, to be asked for its quantiles."""

from bisect import bisect_right
from collections.abc import Iterable
from math import ceil
from typing import Final


class Distribution:
    """Values in nanoseconds. Quantiles are values that occurred: the least that so many do not exceed."""

    __slots__ = ("_sorted", "_values")

    def __init__(self, values: Iterable[int]) -> None:
        self._values = tuple(values)
        self._sorted: tuple[int, ...] | None = None

    def __len__(self) -> int:
        return len(self._values)

    @property
    def values(self) -> tuple[int, ...]:
        """All values, sorted; only when it is asked for, which is not at every look."""
        if self._sorted is None:
            self._sorted = tuple(sorted(self._values))
        return self._sorted

    def quantile(self, share: float) -> int:
        """Return the value that `share` of all, 0 to 1, do not exceed. Raises IndexError when there is none."""
        return self.values[max(0, ceil(share * len(self)) - 1)]

    def share_over(self, limit: int) -> float:
        """Return which share of all, 0 to 1, exceeds a limit; 0 when there is none."""
        return (len(self) - bisect_right(self.values, limit)) / len(self) if self else 0.0


NOTHING: Final = Distribution(())
