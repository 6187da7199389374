"""Messages that were held up on their way and then came at once: their stamps have no gap, their receipt has."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from statistics import median_low
from typing import Final, NamedTuple

LEAST_HELD_NS: Final = 500_000_000
AT_ONCE: Final = 3
"""So many come within one period: several messages at once, and not one that took longer."""


class Burst(NamedTuple):
    """The first of the messages that came at once: when it was received, and for how long it was held up."""

    at: int
    held: int


def bursts(arrivals: Sequence[tuple[int, int]]) -> Iterator[Burst]:
    """Yield the bursts among stamps and times of receipt, in nanoseconds, in the order of their receipt.

    Of arrivals that come in parts, each begins with the last AT_ONCE of the one before: so every burst is found once.
    """
    if len(arrivals) <= AT_ONCE:
        return
    usual = median_low([after - before for (before, _), (after, _) in pairwise(arrivals)])
    least = max(LEAST_HELD_NS, AT_ONCE * usual)
    for before, first, last in zip(arrivals, arrivals[1:], arrivals[AT_ONCE:], strict=False):
        held = (first[1] - first[0]) - (before[1] - before[0])
        if held >= least and first[0] > before[0] and last[1] - first[1] < usual:
            yield Burst(first[1], held)
