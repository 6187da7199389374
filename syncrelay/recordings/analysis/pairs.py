"""How far the messages of one topic are from the nearest of another."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from syncrelay.explain.nearest import all_sides, in_order
from syncrelay.explain.rows import Column, Rows, blocks
from syncrelay.recordings.analysis.streams import Stream
from syncrelay.recordings.analysis.topics import Spread, spread

# All pairs of up to 4 topics are shown; of more topics, the widest pairs.
_ALL_SHOWN: Final = 6
_WIDEST: Final = 4


@dataclass(frozen=True, slots=True)
class Pair:
    """The signed distance of each message of `first` to the nearest of `second`: positive where that is later.

    `distance` is the same without the sign. All of `offsets` in the order of the stamps.
    """

    first: str
    second: str
    signed: Spread
    distance: Spread
    offsets: Column


def pair(first: Stream, second: Stream, offsets: tuple[int, int]) -> Pair | None:
    """Return how far the messages of the slower stream are from the other's; None where one has no stamps."""
    one, other = (
        in_order(stream.as_received(), offset).stamps for stream, offset in zip((first, second), offsets, strict=True)
    )
    if not len(one) or not len(other):
        return None
    if len(one) > len(other):
        first, second, one, other = second, first, other, one
    kept = Rows(1)
    for before, after, _ in all_sides(one, other):
        kept.append(np.where(after <= before, after, -before)[:, None])
    signed = kept.column(0)
    distance = spread(lambda: map(np.abs, blocks(signed)))
    return Pair(first.topic, second.topic, spread(lambda: blocks(signed)), distance, signed)


def worth_seeing(pairs: Sequence[Pair]) -> tuple[int, ...]:
    """Return the places of the pairs to show first: all where they are few, otherwise those farthest apart.

    These decide about slop. They are ranked by the 95th percentile: a single gap would rank all pairs of its topic
    first.
    """
    if len(pairs) <= _ALL_SHOWN:
        return tuple(range(len(pairs)))
    return tuple(sorted(range(len(pairs)), key=lambda at: -pairs[at].distance.high)[:_WIDEST])
