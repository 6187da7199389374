"""A sample of one quantity, to be asked for its quantiles."""

from bisect import bisect_right
from collections.abc import Sequence
from math import ceil
from typing import Final


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
        return self.values[max(0, ceil(share * len(self)) - 1)]

    def share_over(self, limit: int) -> float:
        """Return which share of all, 0 to 1, exceeds a limit; 0 when there is none."""
        if not self or max(self._values) <= limit:
            # As nearly always, and seen without sorting.
            return 0.0
        return (len(self) - bisect_right(self.values, limit)) / len(self)


NOTHING: Final = Distribution(())
