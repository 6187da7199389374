"""MCAP files, read by their index, or by one made in a first pass if there is none that can be trusted.

mcap's own reader stops at the first damage, and without an index it sorts the whole file in memory. A robot that lost
power leaves exactly such files, so records are walked here and only parsed by mcap.
"""

import zlib
from collections.abc import Collection, Iterator
from contextlib import suppress
from functools import partial
from struct import Struct
from typing import Final

from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk, ChunkIndex, Schema, Statistics

from syncrelay.errors import BagError
from syncrelay.recordings.bag.effort import Effort
from syncrelay.recordings.bag.losses import Losses
from syncrelay.recordings.bag.mcap_parts import Parts, PlainChunk, is_mixed, is_needed, plain_chunk
from syncrelay.recordings.bag.mcap_records import (
    MESSAGE_FIELDS,
    RECORD,
    UNREADABLE,
    add_messages,
    parsed,
    parsed_from,
    records,
    require_record,
    unpacked,
)
from syncrelay.recordings.bag.names import full_type_name, topic_name
from syncrelay.recordings.bag.qos import read_profiles
from syncrelay.recordings.bag.recording import Channel, Definition, Encoding, RawMessage
from syncrelay.recordings.bag.segments import PIECE, Pieces, Segment, extent, read_in_order
from syncrelay.recordings.bag.sources import NoIndexError, Source

MAGIC: Final = b"\x89MCAP0\r\n"
"""What an MCAP file begins with, and ends with if it was closed."""

# Offset of the summary, offset of its offsets, checksum from the summary up to here.
_FOOTER: Final = Struct("<QQI")
_CHECKSUM_SIZE: Final = 4
# A DATA_END record holds only a checksum.
_DATA_END_SIZE: Final = 4
_TAIL: Final = 32_000
# No schema or channel record is longer.
_LONGEST_TEXT: Final = 64_000_000
_ENCODINGS: Final[dict[str, Encoding | str]] = {each.value: each for each in Encoding}


class McapFile:
    """One MCAP file, opened for reading; see Recording."""

    def __init__(self, file: Source, name: str) -> None:
        """Read a file that messages call `name`; raises NoIndexError if one behind a URL has no trusted index."""
        self._file = file
        self._losses = Losses(name)
        self.size = file.size
        self.position = 0
        self._effort = Effort()
        self._segments: list[Segment] = []
        self._chunked: set[Segment] = set()
        self._schemas: dict[int, Schema] = {}
        self._records: dict[int, ChannelRecord] = {}
        self._holds: dict[Segment, frozenset[int]] = {}
        self._plain: dict[Segment, PlainChunk] = {}
        self._counts: dict[int, int] = {}
        if not self._read_index():
            if not file.is_near:
                raise NoIndexError
            self._scan()
        self._by_id = {number: self._channel(record) for number, record in self._records.items()}
        self.channels = tuple(self._by_id.values())
        self.begin, self.end = extent(self._segments)

    @property
    def faults(self) -> list[str]:
        """See Recording."""
        return self._losses.sentences

    def batches(self, wanted: Collection[Channel]) -> Iterator[list[RawMessage]]:
        """See Recording."""
        among = frozenset(wanted)
        chosen = {number: channel if channel in among else None for number, channel in self._by_id.items()}
        needed = sorted(
            (each for each in self._segments if is_needed(self._holds.get(each), chosen)), key=lambda each: each.begin
        )
        self.position = sum(each.size for each in self._segments) - sum(each.size for each in needed)
        parts = None
        if not self._file.is_near:
            plain = {each: chunk for each, chunk in self._plain.items() if is_mixed(self._holds.get(each), chosen)}
            numbers = [number for number, channel in chosen.items() if channel is not None]
            parts = Parts(self._file, needed, plain, numbers)
        self._effort = Effort()
        said, count = self.faults, 0
        read = partial(self._read, channels=chosen, parts=parts)
        for segment, found in read_in_order(needed, read, self._losses):
            self.position += segment.size
            count += len(found)
            yield found
        self.position = self.size
        told = sum(self._counts.get(number, 0) for number, channel in chosen.items() if channel is not None)
        is_chosen = parts is not None or len(needed) < len(self._segments)
        if is_chosen and count < told and said == self.faults:
            self._losses.say(f"the index finds {count} of the {told} messages in its statistics")

    def close(self) -> None:
        """See Recording."""
        self._file.close()

    def _channel(self, record: ChannelRecord) -> Channel:
        schema = self._schemas.get(record.schema_id)
        return Channel(
            record.id,
            topic_name(record.topic),
            full_type_name(schema.name) if schema else "",
            _ENCODINGS.get(record.message_encoding, record.message_encoding),
            Definition(schema.encoding, schema.data.decode(errors="replace")) if schema and schema.data else None,
            read_profiles(record.metadata.get("offered_qos_profiles", "")),
            record.metadata.get("topic_type_hash", ""),
        )

    def _read(self, segment: Segment, channels: dict[int, Channel | None], parts: Parts | None) -> list[RawMessage]:
        found: list[RawMessage] = []
        try:
            content = parts.of(segment) if parts is not None else None
            add_messages(found, self._content(segment) if content is None else content, channels, self._effort)
        except UNREADABLE as fault:
            if found:
                self._effort.found_message()
            self._losses.damaged(f"the chunk at byte {segment.offset}", fault, read=len(found))
        return found

    def _content(self, segment: Segment) -> bytes:
        if segment not in self._chunked:
            return self._bytes(segment.offset, segment.size)
        opcode, length = RECORD.unpack(self._bytes(segment.offset, RECORD.size))
        if opcode != Opcode.CHUNK or length != segment.size - RECORD.size:
            raise ValueError("it does not match the index")
        return unpacked(self._chunk(segment), self._effort)

    def _chunk(self, record: Segment) -> Chunk:
        self._file.seek(record.offset + RECORD.size)
        chunk: Chunk = parsed_from(Chunk, self._file, record.size - RECORD.size)
        return chunk

    def _bytes(self, place: int, size: int) -> bytes:
        """Read bytes that are known to be in the file."""
        self._file.seek(place)
        return self._file.read(size)

    def _walk(self, place: int, end: int) -> Iterator[tuple[int, int, int]]:
        """Yield opcode, begin and end of the content of each record between two places of the file.

        Raises EOFError if the last record is cut off, and ValueError where no record begins or too many hold nothing.
        """
        while place < end:
            begin = place + RECORD.size
            opcode, length = RECORD.unpack(self._bytes(place, RECORD.size)) if begin <= end else (0, end)
            place = begin + length
            if place > end:
                raise EOFError("a record ends past the end")
            require_record(opcode)
            self._effort.pass_record()
            yield opcode, begin, place

    def _read_index(self) -> bool:
        """Take channels and chunks from the summary at the end of the file; False if there is none, or it is wrong."""
        try:
            chunks = list(self._summary())
        except UNREADABLE:
            chunks = []
        ordered = sorted(chunks, key=lambda each: each.chunk_start_offset)
        ends = [each.chunk_start_offset + each.chunk_length for each in ordered]
        if (
            not (chunks and self._records)
            or ordered[0].chunk_start_offset < len(MAGIC)
            or ends[-1] > self.size
            or any(end > after.chunk_start_offset for end, after in zip(ends, ordered[1:], strict=False))
            or any(each.message_start_time > each.message_end_time for each in chunks)
        ):
            return False
        self._segments = [
            Segment(each.chunk_start_offset, each.chunk_length, each.message_start_time, each.message_end_time)
            for each in chunks
        ]
        self._chunked = set(self._segments)
        if self._counts:
            held = (frozenset(each.message_index_offsets) for each in chunks)
            self._holds = dict(zip(self._segments, held, strict=True))
            plain = zip(self._segments, map(plain_chunk, chunks), strict=True)
            self._plain = {segment: chunk for segment, chunk in plain if chunk is not None}
        return True

    def _summary(self) -> Iterator[ChunkIndex]:
        """Keep the schemas and channels of the summary and yield its chunks; raises one of UNREADABLE."""
        end = self.size - len(MAGIC) - RECORD.size - _FOOTER.size
        if end < len(MAGIC):
            raise EOFError("there is no footer")
        # This usually fetches the whole summary together with the footer.
        tail = max(len(MAGIC), self.size - _TAIL)
        self._file.expect([(tail, self.size - tail)])
        head, footer = self._bytes(end, RECORD.size), self._bytes(end + RECORD.size, _FOOTER.size)
        begin, _, checksum = _FOOTER.unpack(footer)
        if head != RECORD.pack(Opcode.FOOTER, _FOOTER.size) or not len(MAGIC) <= begin < end:
            raise ValueError("there is no summary")
        self._file.expect([(begin, self.size - begin)])
        if checksum not in (0, self._checksum(begin, end + RECORD.size + _FOOTER.size - _CHECKSUM_SIZE)):
            raise ValueError("its checksum is wrong")
        count = told = 0
        self._counts = {}
        for opcode, place, stop in self._walk(begin, end):
            match opcode:
                case Opcode.SCHEMA | Opcode.CHANNEL:
                    self._define(opcode, self._text(place, stop))
                case Opcode.CHUNK_INDEX:
                    self._effort.found_message()
                    yield parsed(ChunkIndex, self._text(place, stop))
                    count += 1
                case Opcode.STATISTICS:
                    statistics = parsed(Statistics, self._text(place, stop))
                    told = statistics.chunk_count
                    # Without a checksum, a flipped bit in the index could hide a channel.
                    self._counts = statistics.channel_message_counts if checksum else {}
        if told not in (0, count):
            raise ValueError("chunks are missing in it")

    def _checksum(self, begin: int, end: int) -> int:
        checksum = 0
        for place in range(begin, end, PIECE):
            checksum = zlib.crc32(self._bytes(place, min(PIECE, end - place)), checksum)
        return checksum

    def _text(self, begin: int, end: int) -> bytes:
        """Read the content of a record that describes something; raises ValueError if it is too large for that."""
        if end - begin > _LONGEST_TEXT:
            raise ValueError(f"{end - begin} bytes are no description")
        return self._bytes(begin, end - begin)

    def _scan(self) -> None:
        """Find channels and segments by going through the file, as far as it can be read."""
        self._schemas.clear()
        self._records.clear()
        self._effort = Effort()
        loose = Pieces()
        place = len(MAGIC)
        try:
            for opcode, begin, end in self._walk(place, self.size):
                if opcode == Opcode.DATA_END and end - begin == _DATA_END_SIZE:
                    break
                self._note(opcode, begin, end, loose)
                place = end
            else:
                self._losses.not_closed()
        except UNREADABLE:
            self._losses.cut_off(place, self.size)
        self._segments += loose.segments()

    def _note(self, opcode: int, begin: int, end: int, loose: Pieces) -> None:
        """Use one record of the first pass."""
        place = begin - RECORD.size
        try:
            match opcode:
                case Opcode.SCHEMA | Opcode.CHANNEL:
                    self._define(opcode, self._text(begin, end))
                case Opcode.MESSAGE:
                    self._effort.found_message()
                    time = int.from_bytes(self._bytes(begin, min(MESSAGE_FIELDS, end - begin))[6:14], "little")
                    loose.add(Segment(place, end - place, time, time))
                case Opcode.CHUNK:
                    self._note_chunk(Segment(place, end - place, 0, 0))
        except UNREADABLE as fault:
            self._losses.damaged(f"the {Opcode(opcode).name.lower()} at byte {place}", fault)

    def _note_chunk(self, record: Segment) -> None:
        chunk = self._chunk(record)
        content = unpacked(chunk, self._effort)
        segment = Segment(record.offset, record.size, chunk.message_start_time, chunk.message_end_time)
        self._segments.append(segment)
        self._chunked.add(segment)
        # Damage is reported when the messages are read.
        with suppress(*UNREADABLE):
            for opcode, begin, end in records(content):
                if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._define_in(record, opcode, content[begin:end])
                if opcode == Opcode.MESSAGE:
                    self._effort.found_message()
                else:
                    self._effort.pass_record()

    def _define_in(self, chunk: Segment, opcode: int, content: bytes) -> None:
        try:
            self._define(opcode, content)
        except UNREADABLE as fault:
            self._losses.damaged(f"a {Opcode(opcode).name.lower()} in the chunk at byte {chunk.offset}", fault)

    def _define(self, opcode: int, content: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = parsed(Schema, content)
            self._schemas[schema.id] = schema
        else:
            channel = parsed(ChannelRecord, content)
            self._records[channel.id] = channel


def open_mcap(source: Source, name: str) -> McapFile:
    """Open an MCAP file; raises BagError if nothing of it can be read, and NoIndexError as McapFile does."""
    file = McapFile(source, name)
    if not file.channels:
        file.close()
        raise BagError(f"{name}: no message can be read{': ' + file.faults[0] if file.faults else ', it is empty'}")
    return file
