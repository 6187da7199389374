"""Match rate and span against slop, and match rate against queue size: both read off the tightest sets."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from syncrelay.bag.analysis.nearest import Tightest

_SHARES: Final = (0.05, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99, 1.0)


def slop_curve(
    found: Tightest, *, marks: Sequence[int] = (), shares: Sequence[float] = _SHARES
) -> list[tuple[int, float, int]]:
    """Return slops in nanoseconds, the share of the slowest input's messages that each matches, and the median span.

    A slop for each of `shares`, where it is reached first, and those of `marks`.
    """
    slops = {int(each) for each in np.quantile(found.spans, shares, method="inverted_cdf")} | set(marks)
    return [(slop, found.share_within(slop), _median_span(found, slop)) for slop in sorted(slops)]


def queue_curve(
    found: Tightest, slop: int, *, marks: Sequence[int] = (), shares: Sequence[float] = _SHARES
) -> list[tuple[int, float]]:
    """Return queue sizes and the share of the slowest input's messages whose sets within a slop each holds."""
    within = found.queues[found.spans <= slop]
    if not len(within):
        return []
    sizes = {int(each) for each in np.quantile(within, shares, method="inverted_cdf")} | set(marks)
    return [(size, found.share_held(size, slop)) for size in sorted(sizes)]


def _median_span(found: Tightest, slop: int) -> int:
    within = found.spans[found.spans <= slop]
    return int(np.quantile(within, 0.5, method="inverted_cdf")) if len(within) else 0
