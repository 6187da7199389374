"""MCAP files (the specification at mcap.dev): by their index, or by one made in a first pass where there is none."""

import os
from collections.abc import Callable, Collection, Iterator
from io import BytesIO
from pathlib import Path
from struct import Struct, error
from typing import BinaryIO, Final

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk, Schema
from mcap.stream_reader import CRCValidationError, get_chunk_data_stream
from mcap.summary import Summary
from zstandard import ZstdError

from syncrelay.bag.names import full_type_name, topic_name
from syncrelay.bag.qos import read_profiles
from syncrelay.bag.recording import Channel, Definition, Encoding, RawMessage
from syncrelay.bag.segments import Segment, read_in_order
from syncrelay.errors import BagError

MAGIC: Final = b"\x89MCAP0\r\n"
"""What an MCAP file begins with, and ends with if it was closed."""

_RECORD: Final = Struct("<BQ")
# Opcode, length, channel id, sequence, log time, publish time; the payload follows.
_MESSAGE: Final = Struct("<BQHIQQ")
# Messages outside of chunks are read by the piece.
_PIECE: Final = 4_000_000
_UNREADABLE: Final = (McapError, CRCValidationError, ZstdError, RuntimeError, error, ValueError)
_ENCODINGS: Final[dict[str, Encoding | str]] = {each.value: each for each in Encoding}


class McapFile:
    """One MCAP file, opened for reading; see Recording."""

    def __init__(self, path: Path, name: str) -> None:
        """Open a file that messages call `name`; raises BagError where it is none."""
        self._name = name
        self._file = path.open("rb")
        self.size = os.fstat(self._file.fileno()).st_size
        self.position = 0
        self.faults: list[str] = []
        self._segments: list[Segment] = []
        self._chunked: set[Segment] = set()
        self._schemas: dict[int, Schema] = {}
        self._records: dict[int, ChannelRecord] = {}
        summary = self._summary()
        if summary is not None and summary.chunk_indexes and summary.channels:
            self._schemas, self._records = summary.schemas, summary.channels
            self._segments = [
                Segment(each.chunk_start_offset, each.chunk_length, each.message_start_time, each.message_end_time)
                for each in summary.chunk_indexes
            ]
            self._chunked = set(self._segments)
        else:
            self._scan()
        self._by_id = {number: self._channel(record) for number, record in self._records.items()}
        self.channels = tuple(self._by_id.values())
        self.begin = min((each.begin for each in self._segments), default=0)
        self.end = max((each.end for each in self._segments), default=0)

    def messages(self, wanted: Collection[Channel]) -> Iterator[RawMessage]:
        """See Recording."""
        among = frozenset(wanted)
        chosen = {number: channel for number, channel in self._by_id.items() if channel in among}
        for segment, messages in read_in_order(self._segments, lambda each: self._read(each, chosen)):
            self.position += segment.size
            yield from messages
        self.position = self.size

    def close(self) -> None:
        """See Recording."""
        self._file.close()

    def _summary(self) -> Summary | None:
        try:
            return make_reader(self._file).get_summary()
        except (*_UNREADABLE, OSError):
            return None

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

    def _read(self, segment: Segment, wanted: dict[int, Channel]) -> list[RawMessage]:
        try:
            return list(_messages(self._content(segment), wanted))
        except _UNREADABLE as fault:
            self.faults.append(f"{self._name}: the chunk at byte {segment.offset} is damaged and left out: {fault}")
            return []

    def _content(self, segment: Segment) -> bytes:
        self._file.seek(segment.offset)
        if segment not in self._chunked:
            return self._file.read(segment.size)
        self._file.seek(_RECORD.size, os.SEEK_CUR)
        return _unpacked(Chunk.read(ReadDataStream(self._file)))

    def _scan(self) -> None:
        """Find channels and segments by going through the file to its end, or as far as it can be read."""
        self._file.seek(len(MAGIC))
        loose = _Pieces()
        while (place := self._file.tell()) < self.size:
            head = self._file.read(_RECORD.size)
            opcode, length = _RECORD.unpack(head) if len(head) == _RECORD.size else (0, self.size)
            if opcode == Opcode.DATA_END:
                break
            end = place + _RECORD.size + length
            if end > self.size:
                self.faults.append(f"{self._name}: cut off at byte {place} of {self.size}, what is before it is read")
                break
            self._note(opcode, Segment(place, end - place, 0, 0), loose)
            self._file.seek(end)
        self._segments += loose.segments()

    def _note(self, opcode: int, record: Segment, loose: "_Pieces") -> None:
        """Take in what a record of the file says."""
        match opcode:
            case Opcode.SCHEMA | Opcode.CHANNEL:
                self._define(opcode, self._file)
            case Opcode.MESSAGE:
                content = self._file.read(_MESSAGE.size - _RECORD.size)
                time = int.from_bytes(content[6:14], "little")
                loose.add(Segment(record.offset, record.size, time, time))
            case Opcode.CHUNK:
                self._note_chunk(record)

    def _note_chunk(self, record: Segment) -> None:
        try:
            chunk = Chunk.read(ReadDataStream(self._file))
            content = _unpacked(chunk)
        except _UNREADABLE as fault:
            self.faults.append(f"{self._name}: the chunk at byte {record.offset} is damaged and left out: {fault}")
            return
        for opcode, place, _ in _records(content):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._define(opcode, BytesIO(content[place + _RECORD.size :]))
        segment = Segment(record.offset, record.size, chunk.message_start_time, chunk.message_end_time)
        self._segments.append(segment)
        self._chunked.add(segment)

    def _define(self, opcode: int, content: BinaryIO | BytesIO) -> None:
        stream = ReadDataStream(content)
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[schema.id] = schema
        else:
            channel = ChannelRecord.read(stream)
            self._records[channel.id] = channel


def _unpacked(chunk: Chunk) -> bytes:
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    return stream.read(size)


def _records(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, begin and end of each record."""
    place = 0
    while place < len(content):
        opcode, length = _RECORD.unpack_from(content, place)
        end = place + _RECORD.size + length
        yield opcode, place, end
        place = end


def _messages(content: bytes, wanted: dict[int, Channel]) -> Iterator[RawMessage]:
    """Yield the messages of a run of records. The innermost loop of reading: half a microsecond each."""
    unpack, begin_payload, message = _MESSAGE.unpack_from, _MESSAGE.size, Opcode.MESSAGE.value
    find: Callable[[int], Channel | None] = wanted.get
    place, size = 0, len(content)
    while place < size:
        if content[place] != message:
            place += _RECORD.size + _RECORD.unpack_from(content, place)[1]
            continue
        _, length, number, _, time, _ = unpack(content, place)
        end = place + _RECORD.size + length
        channel = find(number)
        if channel is not None:
            yield channel, time, content[place + begin_payload : end]
        place = end


class _Pieces:
    """Messages outside of chunks, as segments that are read whole."""

    def __init__(self) -> None:
        self._done: list[Segment] = []
        self._last: Segment | None = None

    def add(self, record: Segment) -> None:
        """Take a message that stands behind all before."""
        last = self._last
        if last is None or record.offset - last.offset > _PIECE:
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


def open_mcap(path: Path, name: str) -> McapFile:
    """Open an MCAP file; raises BagError where nothing of it can be read."""
    file = McapFile(path, name)
    if not file.channels:
        file.close()
        raise BagError(f"{name}: no message can be read{': ' + file.faults[0] if file.faults else ', it is empty'}")
    return file
