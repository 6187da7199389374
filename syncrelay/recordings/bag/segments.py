"""A recording as segments that are read whole: chunks of MCAP files and ROS 1 bags, in the order of receive times.

Segments may overlap in time, as recorders write with several threads. Only overlapping ones are held in memory.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Final

from syncrelay.recordings.bag.losses import Losses
from syncrelay.recordings.bag.recording import LATEST, RawMessage

PIECE: Final = 4_000_000
"""How many bytes are read at a time outside of chunks."""

_RECEIVED: Final = itemgetter(1)


@dataclass(frozen=True, slots=True)
class Segment:
    """Messages that stand together in a file: their place, and the first and last receive time by the index."""

    offset: int
    size: int
    begin: int
    end: int


def extent(segments: Sequence[Segment]) -> tuple[int, int]:
    """Return the first and the last receive time of all segments; 0 if there are none."""
    times = [time for each in segments for time in (each.begin, each.end) if 0 <= time <= LATEST]
    return min(times, default=0), max(times, default=0)


def read_in_order(
    segments: Sequence[Segment],
    read: Callable[[Segment], list[RawMessage]],
    losses: Losses,
) -> Iterator[tuple[Segment, list[RawMessage]]]:
    """Yield segments, given in the order in which they begin, with the messages that no later segment can precede.

    What comes too late for that, as its segment tells other times than it has, is counted by `losses`, as is what
    belongs to no channel or no time, and is left out.
    """
    held: list[RawMessage] = []
    until = 0
    for place, segment in enumerate(segments):
        held += read(segment)
        # Timsort merges runs that are sorted already.
        held.sort(key=_RECEIVED)
        held = losses.kept(held)
        too_late = bisect_left(held, until, key=_RECEIVED)
        if too_late:
            losses.too_late(too_late)
        due = len(held)
        if place + 1 < len(segments):
            due = bisect_right(held, segments[place + 1].begin, key=_RECEIVED)
        yield segment, held[:due]
        if due:
            until = held[due - 1][1]
        del held[:due]


class Pieces:
    """Collects messages outside of chunks into segments of about PIECE bytes."""

    def __init__(self) -> None:
        self._done: list[Segment] = []
        self._last: Segment | None = None

    def add(self, record: Segment) -> None:
        """Add a message that stands after all others in the file."""
        last = self._last
        if last is None or record.offset - last.offset > PIECE:
            self._done += self._open()
            self._last = record
        else:
            size = record.offset + record.size - last.offset
            self._last = Segment(last.offset, size, min(last.begin, record.begin), max(last.end, record.end))

    def segments(self) -> list[Segment]:
        """Return the segments that hold all messages."""
        return self._done + self._open()

    def _open(self) -> list[Segment]:
        return [] if self._last is None else [self._last]
