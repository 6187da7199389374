"""What need not be read of an MCAP file: chunks of other channels, and behind a URL other messages in plain chunks."""

from bisect import bisect_right
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from mcap.opcode import Opcode
from mcap.records import ChunkIndex, MessageIndex

from syncrelay.recordings.bag.mcap_records import RECORD, UNREADABLE, parsed
from syncrelay.recordings.bag.recording import Channel
from syncrelay.recordings.bag.segments import Segment
from syncrelay.recordings.bag.sources import Source, Span

# How many chunks' message indexes are fetched together.
_STRETCH: Final = 64
# If more than half of a chunk is wanted, all of it is read, and its checksum is checked.
_PART: Final = 2
# Opcode and length, channel.
_NUMBER: Final = slice(9, 11)


@dataclass(frozen=True, slots=True)
class PlainChunk:
    """An uncompressed chunk: where its records begin and end, and where the index of its messages ends."""

    begin: int
    end: int
    index_end: int


def plain_chunk(index: ChunkIndex) -> PlainChunk | None:
    """Return a chunk of which single messages can be read; None if it has to be read as a whole."""
    end = index.chunk_start_offset + index.chunk_length
    if index.compression or not index.message_index_length or index.compressed_size != index.uncompressed_size:
        return None
    begin = end - index.compressed_size
    return PlainChunk(begin, end, end + index.message_index_length) if begin > index.chunk_start_offset else None


def is_needed(held: Collection[int], channels: Mapping[int, Channel | None]) -> bool:
    """Tell whether a chunk is read: not if a trusted index names only channels that are not wanted.

    `held` are the channel numbers in the index, none if it cannot be trusted; unwanted `channels` are None.
    """
    return not held or any(number not in channels or channels[number] is not None for number in held)


def is_mixed(held: Collection[int], channels: Mapping[int, Channel | None]) -> bool:
    """Tell whether a needed chunk also holds channels that are not wanted, all of them known."""
    return all(each in channels for each in held) and None in {channels[each] for each in held}


class Parts:
    """Reads the wanted messages alone, chunk by chunk in a given order; requests are planned for 64 chunks at once."""

    def __init__(
        self, source: Source, segments: Sequence[Segment], plain: dict[Segment, PlainChunk], wanted: Collection[int]
    ) -> None:
        """Read from a source; segments that are not in `plain` are read as a whole by the caller."""
        self._source = source
        self._segments = segments
        self._plain = plain
        self._wanted = frozenset(wanted)
        self._place = {segment: number for number, segment in enumerate(segments)}
        self._spans: dict[Segment, tuple[Span, ...]] = {}

    def of(self, segment: Segment) -> bytes | None:
        """Return the records of a chunk's wanted messages; None if all of it has to be read."""
        place = self._place[segment]
        if place % _STRETCH == 0:
            self._plan(self._segments[place : place + _STRETCH])
        spans = self._spans.pop(segment, None)
        if spans is None:
            return None
        records = [self._source.read(begin, size) for begin, size in spans]
        are_wanted = (
            record[:1] == bytes([Opcode.MESSAGE]) and int.from_bytes(record[_NUMBER], "little") in self._wanted
            for record in records
        )
        # Otherwise the index is wrong.
        return b"".join(records) if all(are_wanted) else None

    def _plan(self, segments: Sequence[Segment]) -> None:
        chunks = {each: self._plain[each] for each in segments if each in self._plain}
        self._source.expect([(each.end, each.index_end - each.end) for each in chunks.values()])
        for segment, chunk in chunks.items():
            try:
                spans = tuple(self._looked_up(chunk))
            except UNREADABLE:
                continue
            if sum(size for _, size in spans) * _PART < segment.size:
                self._spans[segment] = spans
        read = ([*self._spans[each]] if each in self._spans else [(each.offset, each.size)] for each in segments)
        self._source.expect([span for spans in read for span in spans])

    def _looked_up(self, chunk: PlainChunk) -> Iterator[Span]:
        """Yield the place of each wanted message of a chunk, up to the next message; raises one of UNREADABLE."""
        content = self._source.read(chunk.end, chunk.index_end - chunk.end)
        size = chunk.end - chunk.begin
        places: list[int] = []
        wanted: list[int] = []
        at = 0
        while at < len(content):
            opcode, length = RECORD.unpack_from(content, at)
            at += RECORD.size + length
            if opcode != Opcode.MESSAGE_INDEX or at > len(content):
                raise ValueError("it is no index of messages")
            index = parsed(MessageIndex, content[at - length : at])
            offsets = [offset for _, offset in index.records]
            places += offsets
            wanted += offsets if index.channel_id in self._wanted else ()
        places = sorted({*places, size})
        if places[-1] > size or not wanted:
            raise ValueError("it points past its chunk")
        for offset in sorted(set(wanted)):
            following = places[bisect_right(places, offset)]
            yield chunk.begin + offset, following - offset
