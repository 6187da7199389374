"""How far the stamps of a group's inputs lie apart, as a histogram, and the values that are marked in the charts."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from syncrelay.config import GroupConfig
from syncrelay.recordings.analysis.pairs import Pair

_BINS: Final = 60
# What lies so many times farther out than most do is counted, not drawn: it would press all others into one bar.
_FARTHEST: Final = 1.5
# A slop line so many times farther out than the offsets is left out for the same reason.
_FARTHEST_LINE: Final = 3


@dataclass(frozen=True, slots=True)
class Marks:
    """The values of a key as they are in the file and as they are suggested; None where there is none, or no better."""

    now: int | None
    then: int | None

    @property
    def known(self) -> tuple[int, ...]:
        """Both, or what there is of them."""
        return tuple(each for each in (self.now, self.then) if each is not None)


def slop_marks(now: GroupConfig, then: GroupConfig) -> Marks:
    """Return the slops of a group as it is and as it is suggested."""
    return _marks(_slop(now), _slop(then))


def queue_marks(now: GroupConfig, then: GroupConfig) -> Marks:
    """Return the queue sizes of a group as it is and as it is suggested."""
    return _marks(now.options.queue_size, then.options.queue_size)


@dataclass(frozen=True, slots=True)
class Histogram:
    """How many offsets of a pair lie from one edge to the next, in nanoseconds, and how many outside of all."""

    edges: tuple[float, ...]
    counts: tuple[int, ...]
    outside: int


def histogram(pair: Pair, slops: Marks) -> Histogram:
    """Return how the offsets of a pair are spread, slops within what is drawn if they are not far out."""
    margin = round(_FARTHEST * (pair.signed.high - pair.signed.low))
    low = max(pair.signed.least, pair.signed.low - margin)
    high = min(pair.signed.greatest, pair.signed.high + margin)
    reach = max(abs(low), abs(high), 1)
    lines = [slop for slop in slops.known if slop <= _FARTHEST_LINE * reach]
    low, high = (min([low, *(-slop for slop in lines)]), max([high, *lines]))
    margin = max((high - low) // 20, 10)
    edges = np.linspace(low - margin, high + margin, _BINS + 1)
    counts, _ = np.histogram(pair.offsets, edges)
    return Histogram(tuple(edges.tolist()), tuple(counts.tolist()), len(pair.offsets) - int(counts.sum()))


def _slop(group: GroupConfig) -> int | None:
    return None if group.options.matched_by or group.options.tolerance is None else group.options.tolerance.ns


def _marks(now: int | None, then: int | None) -> Marks:
    return Marks(now, None if then == now else then)
