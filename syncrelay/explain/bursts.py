"""Messages that were held up on their way and then came at once: their stamps have no gap, their receipt has."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from statistics import median_low
from typing import Final, NamedTuple

LEAST_HELD_NS: Final = 500_000_000
# So many periods, so that it is several messages that come at once and not one that took longer.
_LEAST_PERIODS: Final = 3


class Burst(NamedTuple):
    """The first of the messages that came at once: when it was received, and for how long it was held up."""

    at: int
    held: int


def bursts(arrivals: Sequence[tuple[int, int]]) -> Iterator[Burst]:
    """Yield the bursts among stamps and times of receipt, in nanoseconds; whoever is just slow from then on is none."""
    delays = [received - stamp for stamp, received in arrivals]
    periods = [after - before for (before, _), (after, _) in pairwise(arrivals)]
    least = max(LEAST_HELD_NS, _LEAST_PERIODS * median_low(periods)) if periods else 0
    for index, period in enumerate(periods, start=1):
        held = delays[index] - delays[index - 1]
        if held >= least and period > 0 and min(delays[index:]) <= delays[index] - held // 2:
            yield Burst(arrivals[index][1], held)
