"""A recording as segments that are read whole: chunks of MCAP files and ROS 1 bags, in the order of receive times.

Segments may overlap in time, as several threads write them. Only what overlaps is held in memory.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Final

from syncrelay.bag.recording import RawMessage

_RECEIVED: Final = itemgetter(1)


@dataclass(frozen=True, slots=True)
class Segment:
    """Messages that stand together: where in the file, and the receive times of the first and the last of them."""

    offset: int
    size: int
    begin: int
    end: int


def read_in_order(
    segments: Sequence[Segment], read: Callable[[Segment], list[RawMessage]]
) -> Iterator[tuple[Segment, list[RawMessage]]]:
    """Yield, for each segment in turn, the messages that nothing later can precede."""
    by_time = sorted(segments, key=lambda segment: segment.begin)
    held: list[RawMessage] = []
    for place, segment in enumerate(by_time):
        held += read(segment)
        # Sorted runs, one behind another, are merged in one go.
        held.sort(key=_RECEIVED)
        due = len(held)
        if place + 1 < len(by_time):
            due = bisect_right(held, by_time[place + 1].begin, key=_RECEIVED)
        yield segment, held[:due]
        del held[:due]
