"""Where the messages of an MCAP file are: by its summary, or by a first pass if there is none that can be trusted.

mcap's own reader stops at the first damage, and without an index it sorts the whole file in memory. A robot that lost
power leaves exactly such files, so records are walked here and only parsed by mcap.
"""

import zlib
from collections.abc import Iterator
from contextlib import suppress
from itertools import chain
from struct import Struct
from typing import Final

from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk, ChunkIndex, Schema, Statistics

from syncrelay.recordings.bag.effort import Effort
from syncrelay.recordings.bag.losses import Losses
from syncrelay.recordings.bag.mcap_parts import PlainChunk, plain_chunk
from syncrelay.recordings.bag.mcap_records import (
    MESSAGE_FIELDS,
    RECORD,
    UNREADABLE,
    parsed,
    records,
    require_record,
    unpacked,
)
from syncrelay.recordings.bag.segments import Pieces, Segment
from syncrelay.recordings.bag.sources import NoIndexError, Source

MAGIC: Final = b"\x89MCAP0\r\n"
"""What an MCAP file begins with, and ends with if it was closed."""

# Offset of the summary, offset of its offsets, checksum from the summary up to here.
_FOOTER: Final = Struct("<QQI")
_CHECKSUM_SIZE: Final = 4
# A DATA_END record holds only a checksum.
_DATA_END_SIZE: Final = 4
_TAIL: Final = 32_000
# Of a million chunks.
_LONGEST_SUMMARY: Final = 256_000_000


class McapIndex:
    """The channels, schemas and segments of an MCAP file.

    `chunked` are the segments that are chunks. From a trusted summary come `holds`, the channel numbers of
    each chunk, `plain` the uncompressed chunks, and `counts` the number of messages of each channel.
    """

    def __init__(self, file: Source, losses: Losses) -> None:
        """Read the index of a file; raises NoIndexError if one behind a URL has none that can be trusted."""
        self._file = file
        self._losses = losses
        self._size = file.size
        self._effort = Effort()
        self.segments: list[Segment] = []
        self.chunked: set[Segment] = set()
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, ChannelRecord] = {}
        self.holds: dict[Segment, frozenset[int]] = {}
        self.plain: dict[Segment, PlainChunk] = {}
        self.counts: dict[int, int] = {}
        if not self._read_index():
            if not file.is_near:
                raise NoIndexError
            in_summary = self.schemas, self.channels
            self._scan()
            # A recording without a message describes its topics in the summary alone.
            if not (self.channels or losses.sentences):
                self.schemas, self.channels = in_summary

    def _read_index(self) -> bool:
        """Take channels and chunks from the summary at the end of the file; False if there is none, or it is wrong."""
        try:
            chunks = list(self._summary())
        except UNREADABLE:
            chunks = []
        places = sorted((each.chunk_start_offset, each.chunk_start_offset + each.chunk_length) for each in chunks)
        borders = [len(MAGIC), *chain.from_iterable(places), self._size]
        are_apart = borders == sorted(borders)
        are_in_time = all(each.message_start_time <= each.message_end_time for each in chunks)
        if not (chunks and self.channels and are_apart and are_in_time):
            return False
        self.segments = [
            Segment(each.chunk_start_offset, each.chunk_length, each.message_start_time, each.message_end_time)
            for each in chunks
        ]
        self.chunked = set(self.segments)
        if self.counts:
            held = (frozenset(each.message_index_offsets) for each in chunks)
            self.holds = dict(zip(self.segments, held, strict=True))
            plain = zip(self.segments, map(plain_chunk, chunks), strict=True)
            self.plain = {segment: chunk for segment, chunk in plain if chunk is not None}
        return True

    def _summary(self) -> Iterator[ChunkIndex]:
        """Keep the schemas and channels of the summary and yield its chunks; raises one of UNREADABLE."""
        end = self._size - len(MAGIC) - RECORD.size - _FOOTER.size
        if end < len(MAGIC):
            raise EOFError("there is no footer")
        # This usually fetches the whole summary together with the footer.
        tail = max(len(MAGIC), self._size - _TAIL)
        self._file.expect([(tail, self._size - tail)])
        head, footer = self._file.read(end, RECORD.size), self._file.read(end + RECORD.size, _FOOTER.size)
        begin, _, checksum = _FOOTER.unpack(footer)
        has_footer = head == RECORD.pack(Opcode.FOOTER, _FOOTER.size)
        if not has_footer or not len(MAGIC) <= begin < end or end - begin > _LONGEST_SUMMARY:
            raise ValueError("there is no summary")
        self._file.expect([(begin, self._size - begin)])
        summary = self._file.read(begin, end - begin)
        if checksum not in (0, zlib.crc32(head + footer[:-_CHECKSUM_SIZE], zlib.crc32(summary))):
            raise ValueError("its checksum is wrong")
        count = expected = 0
        self.counts = {}
        for opcode, place, stop in records(summary):
            self._effort.pass_record()
            content = summary[place:stop]
            match opcode:
                case Opcode.SCHEMA | Opcode.CHANNEL:
                    self._define(opcode, content)
                case Opcode.CHUNK_INDEX:
                    self._effort.found_message()
                    yield parsed(ChunkIndex, content)
                    count += 1
                case Opcode.STATISTICS:
                    statistics = parsed(Statistics, content)
                    expected = statistics.chunk_count
                    # Without a checksum, a flipped bit in the index could hide a channel.
                    self.counts = statistics.channel_message_counts if checksum else {}
        if expected not in (0, count):
            raise ValueError("chunks are missing in it")

    def _scan(self) -> None:
        """Find channels and segments by going through the file, as far as it can be read."""
        self.schemas, self.channels, self._effort = {}, {}, Effort()
        loose = Pieces()
        place = len(MAGIC)
        try:
            while place < self._size:
                begin = place + RECORD.size
                opcode, length = RECORD.unpack(self._file.read(place, RECORD.size))
                require_record(opcode)
                if begin + length > self._size:
                    raise EOFError("a record ends past the end")
                self._effort.pass_record()
                if opcode == Opcode.DATA_END and length == _DATA_END_SIZE:
                    break
                self._note(opcode, begin, begin + length, loose)
                place = begin + length
            else:
                self._losses.not_closed()
        except UNREADABLE:
            self._losses.cut_off(place, self._size)
        self.segments += loose.segments()

    def _note(self, opcode: int, begin: int, end: int, loose: Pieces) -> None:
        """Use one record of the first pass."""
        place = begin - RECORD.size
        try:
            match opcode:
                case Opcode.SCHEMA | Opcode.CHANNEL:
                    self._define(opcode, self._file.read(begin, end - begin))
                case Opcode.MESSAGE:
                    self._effort.found_message()
                    time = int.from_bytes(self._file.read(begin, min(MESSAGE_FIELDS, end - begin))[6:14], "little")
                    loose.add(Segment(place, end - place, time, time))
                case Opcode.CHUNK:
                    self._note_chunk(begin, end)
        except UNREADABLE as fault:
            self._losses.damaged(f"the {Opcode(opcode).name.lower()} at byte {place}", fault)

    def _note_chunk(self, begin: int, end: int) -> None:
        chunk = parsed(Chunk, self._file.read(begin, end - begin))
        content = unpacked(chunk, self._effort)
        place = begin - RECORD.size
        segment = Segment(place, end - place, chunk.message_start_time, chunk.message_end_time)
        self.segments.append(segment)
        self.chunked.add(segment)
        # Damage is reported when the messages are read.
        with suppress(*UNREADABLE):
            for opcode, first, last in records(content):
                if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._define_in(place, opcode, content[first:last])
                if opcode == Opcode.MESSAGE:
                    self._effort.found_message()
                else:
                    self._effort.pass_record()

    def _define_in(self, chunk: int, opcode: int, content: bytes) -> None:
        try:
            self._define(opcode, content)
        except UNREADABLE as fault:
            self._losses.damaged(f"a {Opcode(opcode).name.lower()} in the chunk at byte {chunk}", fault)

    def _define(self, opcode: int, content: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = parsed(Schema, content)
            self.schemas[schema.id] = schema
        else:
            channel = parsed(ChannelRecord, content)
            self.channels[channel.id] = channel
