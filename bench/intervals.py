"""Intervals of ratios that were measured round by round."""

import math
import statistics
from typing import NamedTuple

CONFIDENCE = 0.95
# Of all processors' time in a round; in more of it the neighbours of a virtual machine decide what is measured.
MOST_STOLEN = 0.05


class Interval(NamedTuple):
    """A median, and the bounds of its 95 % confidence interval."""

    low: float
    median: float
    high: float

    @property
    def width(self):
        """How wide it is, as a share of the median."""
        return (self.high - self.low) / self.median

    def is_above(self, most):
        """Whether the whole of it is."""
        return self.low > most


def median_interval(values):
    """Return the median of one or more values and its confidence interval, which has no end below 6 values.

    The interval is between two of the values themselves (order statistics): of n values, the number that is below the
    true median is that of heads in n throws of a coin, however the values are distributed. That holds for few rounds
    with outliers, where a bootstrap of the median draws the same few values again and again and is too narrow; and it
    gives the same answer twice.
    """
    ordered = sorted(values)
    n = len(ordered)
    below, tail = 0, 0.5**n
    while tail <= (1 - CONFIDENCE) / 2:
        below += 1
        tail += math.comb(n, below) * 0.5**n
    if below == 0:
        return Interval(-math.inf, statistics.median(ordered), math.inf)
    return Interval(ordered[below - 1], statistics.median(ordered), ordered[n - below])


def undisturbed(rounds):
    """Return the rounds in which not too much was stolen, be it from one candidate or from all."""
    return [each for each in rounds if each.stolen <= MOST_STOLEN]


def stolen_share(before, after):
    """Return which share of the processors' time was stolen between two first lines of /proc/stat."""
    spent = [
        late - early for early, late in zip(*(map(int, line.split()[1:9]) for line in (before, after)), strict=True)
    ]
    return spent[7] / max(1, sum(spent))
