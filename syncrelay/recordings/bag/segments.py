"""A recording as segments that are read whole: chunks of MCAP files and ROS 1 bags, in the order of receive times.

Segments may overlap in time, as several threads write them. Only what overlaps is held in memory.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Final

from syncrelay.recordings.bag.losses import Losses
from syncrelay.recordings.bag.recording import LATEST, RawMessage

PIECE: Final = 4_000_000
"""How much is read at a time of what stands in no chunk."""

_RECEIVED: Final = itemgetter(1)


@dataclass(frozen=True, slots=True)
class Segment:
    """Messages that stand together: where in the file, and the receive times of the first and the last of them."""

    offset: int
    size: int
    begin: int
    end: int


def extent(segments: Sequence[Segment]) -> tuple[int, int]:
    """Return the first and the last time of receipt that segments tell of; 0 of none."""
    times = [time for each in segments for time in (each.begin, each.end) if 0 <= time <= LATEST]
    return min(times, default=0), max(times, default=0)


def read_in_order(
    segments: Sequence[Segment],
    read: Callable[[Segment], list[RawMessage]],
    losses: Losses,
) -> Iterator[tuple[Segment, list[RawMessage]]]:
    """Yield, for each segment in turn, the messages that nothing later can precede.

    What comes too late for that, as its segment tells other times than it has, is counted by `losses`, as is what
    belongs to no channel or no time, and is left out.
    """
    by_time = sorted(segments, key=lambda segment: segment.begin)
    held: list[RawMessage] = []
    until = 0
    for place, segment in enumerate(by_time):
        held += read(segment)
        # Sorted runs, one behind another, are merged in one go.
        held.sort(key=_RECEIVED)
        held = losses.kept(held)
        too_late = bisect_left(held, until, key=_RECEIVED)
        if too_late:
            losses.too_late(too_late)
        due = len(held)
        if place + 1 < len(by_time):
            due = bisect_right(held, by_time[place + 1].begin, key=_RECEIVED)
        yield segment, held[:due]
        if due:
            until = held[due - 1][1]
        del held[:due]


class Pieces:
    """Messages outside of chunks, as segments that are read whole."""

    def __init__(self) -> None:
        """Begin with none."""
        self._done: list[Segment] = []
        self._last: Segment | None = None

    def add(self, record: Segment) -> None:
        """Take a message that stands behind all before."""
        last = self._last
        if last is None or record.offset - last.offset > PIECE:
            self._done += self._open()
            self._last = record
        else:
            size = record.offset + record.size - last.offset
            self._last = Segment(last.offset, size, min(last.begin, record.begin), max(last.end, record.end))

    def segments(self) -> list[Segment]:
        """Give what all messages are in."""
        return self._done + self._open()

    def _open(self) -> list[Segment]:
        return [] if self._last is None else [self._last]
