"""ROS 1 bags (format 2.0): by their index, or by one made in a first pass where there is none.

A record is a header of named fields and its content, each with a uint32 length before it. Messages are in chunks.
"""

import bz2
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from operator import itemgetter
from pathlib import Path
from struct import Struct, error
from typing import Any, Final, NamedTuple

import lz4.frame

from syncrelay.bag.names import full_type_name, topic_name
from syncrelay.bag.qos import Profile
from syncrelay.bag.recording import Channel, Definition, Encoding, RawMessage
from syncrelay.bag.segments import Segment, read_in_order
from syncrelay.errors import BagError

MAGIC: Final = b"#ROSBAG V2.0\n"
"""What a bag of this format begins with."""

_MESSAGE, _BAG_HEADER, _CHUNK, _CHUNK_INFO, _CONNECTION = (bytes([op]) for op in (2, 3, 5, 6, 7))
_LENGTH: Final = Struct("<I")
_TIME: Final = Struct("<II")
_NS_PER_SECOND: Final = 1_000_000_000
_UNPACKERS: Final[Mapping[bytes, Callable[[bytes], bytes]]] = {
    b"none": bytes,
    b"bz2": bz2.decompress,
    b"lz4": lz4.frame.decompress,
}
_UNREADABLE: Final = (error, KeyError, ValueError, OSError, EOFError, RuntimeError)
_LATCHED: Final = (Profile(durability="transient_local"),)


class _Record(NamedTuple):
    """A record: its fields, where its content begins, and where it ends."""

    fields: Mapping[bytes, bytes]
    content: int
    end: int


class Ros1File:
    """One ROS 1 bag, opened for reading; see Recording."""

    def __init__(self, path: Path, name: str) -> None:
        """Open a file that messages call `name`; raises BagError where it is encrypted."""
        self._name = name
        self._file = path.open("rb")
        self.size = os.fstat(self._file.fileno()).st_size
        self.position = 0
        self.faults: list[str] = []
        self._by_id: dict[int, Channel] = {}
        self._segments: list[Segment] = []
        try:
            if not self._read_index():
                self._scan()
        except BagError:
            self._file.close()
            raise
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

    def _read_index(self) -> bool:
        """Take channels and chunks from the end of the file; False where there is no such end."""
        try:
            header = self._record_at(len(MAGIC))
            if header.fields.get(b"encryptor"):
                raise BagError(f"{self._name}: is encrypted, which is not supported")
            (place,) = Struct("<Q").unpack(header.fields[b"index_pos"])
            chunks: int = _LENGTH.unpack(header.fields[b"chunk_count"])[0]
            if not place or place > self.size:
                return False
            infos = []
            while place < self.size:
                record = self._record_at(place)
                if record.fields[b"op"] == _CONNECTION:
                    self._connect(record.fields, self._content(record))
                elif record.fields[b"op"] == _CHUNK_INFO and _LENGTH.unpack(record.fields[b"count"])[0]:
                    infos.append(_segment(record.fields))
                place = record.end
        except _UNREADABLE:
            return False
        offsets = sorted(each.offset for each in infos)
        ends = dict(zip(offsets, [*offsets[1:], self.size], strict=True))
        self._segments = [replace(each, size=ends[each.offset] - each.offset) for each in infos]
        return len(infos) == chunks

    def _scan(self) -> None:
        """Find channels and chunks by going through the file to its end, or as far as it can be read."""
        self._by_id.clear()
        self._segments.clear()
        place = len(MAGIC)
        while place < self.size:
            try:
                record = self._record_at(place)
            except _UNREADABLE:
                record = None
            if record is None or record.end > self.size:
                self.faults.append(f"{self._name}: cut off at byte {place} of {self.size}, what is before it is read")
                return
            if record.fields.get(b"op") == _CHUNK:
                self._note_chunk(place, record)
            elif record.fields.get(b"op") == _CONNECTION:
                self._connect(record.fields, self._content(record))
            place = record.end

    def _note_chunk(self, place: int, record: _Record) -> None:
        try:
            content = _unpacked(record.fields, self._content(record))
            times = []
            for each in _records(content):
                if each.fields[b"op"] == _CONNECTION:
                    self._connect(each.fields, content[each.content : each.end])
                elif each.fields[b"op"] == _MESSAGE:
                    times.append(_time(each.fields[b"time"]))
        except _UNREADABLE as fault:
            self.faults.append(_damaged(self._name, place, fault))
            return
        if times:
            self._segments.append(Segment(place, record.end - place, min(times), max(times)))

    def _read(self, segment: Segment, wanted: dict[int, Channel]) -> list[RawMessage]:
        try:
            record = self._record_at(segment.offset)
            content = _unpacked(record.fields, self._content(record))
            return list(_messages(content, wanted))
        except _UNREADABLE as fault:
            self.faults.append(_damaged(self._name, segment.offset, fault))
            return []

    def _record_at(self, place: int) -> _Record:
        self._file.seek(place)
        (header_size,) = _LENGTH.unpack(self._file.read(_LENGTH.size))
        header = self._file.read(header_size)
        (size,) = _LENGTH.unpack(self._file.read(_LENGTH.size))
        content = place + 2 * _LENGTH.size + header_size
        return _Record(_fields(header), content, content + size)

    def _content(self, record: _Record) -> bytes:
        self._file.seek(record.content)
        return self._file.read(record.end - record.content)

    def _connect(self, fields: Mapping[bytes, bytes], content: bytes) -> None:
        number = _LENGTH.unpack(fields[b"conn"])[0]
        if number in self._by_id:
            return
        about = _fields(content)
        self._by_id[number] = Channel(
            number,
            topic_name(fields[b"topic"].decode()),
            full_type_name(about[b"type"].decode()),
            Encoding.ROS1,
            Definition("ros1msg", about[b"message_definition"].decode(errors="replace")),
            _LATCHED if about.get(b"latching") == b"1" else (),
        )


def open_ros1(path: Path, name: str) -> Ros1File:
    """Open a ROS 1 bag; raises BagError where nothing of it can be read."""
    file = Ros1File(path, name)
    if not file.channels:
        file.close()
        raise BagError(f"{name}: no message can be read{': ' + file.faults[0] if file.faults else ', it is empty'}")
    return file


def _damaged(name: str, place: int, fault: BaseException) -> str:
    return f"{name}: the chunk at byte {place} is damaged and left out: {fault}"


def _segment(info: Mapping[bytes, bytes]) -> Segment:
    (place,) = Struct("<Q").unpack(info[b"chunk_pos"])
    return Segment(place, 0, _time(info[b"start_time"]), _time(info[b"end_time"]))


def _time(value: bytes) -> int:
    seconds, nanoseconds = _TIME.unpack(value)
    return int(seconds * _NS_PER_SECOND + nanoseconds)


def _unpacked(fields: Mapping[bytes, bytes], content: bytes) -> bytes:
    return _UNPACKERS[fields[b"compression"]](content)


def _fields(header: bytes) -> dict[bytes, bytes]:
    fields = {}
    place = 0
    while place < len(header):
        (size,) = _LENGTH.unpack_from(header, place)
        place += _LENGTH.size
        name, _, value = header[place : place + size].partition(b"=")
        fields[name] = value
        place += size
    return fields


def _records(content: bytes) -> Iterator[_Record]:
    place = 0
    while place < len(content):
        record = _record_in(content, place)
        yield record
        place = record.end


def _record_in(content: bytes, place: int) -> _Record:
    (header_size,) = _LENGTH.unpack_from(content, place)
    header = content[place + _LENGTH.size : place + _LENGTH.size + header_size]
    behind = place + _LENGTH.size + header_size
    (size,) = _LENGTH.unpack_from(content, behind)
    begin = behind + _LENGTH.size
    if begin + size > len(content):
        raise ValueError("a record ends behind its chunk")
    return _Record(_fields(header), begin, begin + size)


class _Head(NamedTuple):
    """How one recorder lays out the header of a message: the whole record up to the content, as a Struct.

    `fixed` picks, of the values that the Struct gives, those that are `expected` of every message.
    """

    struct: Struct
    fixed: Callable[[tuple[Any, ...]], tuple[Any, ...]]
    expected: tuple[Any, ...]
    connection: int
    time: int


# Before the content of each field: its length, its name and a `=`.
_FORMATS: Final = {b"op": "s", b"conn": "I", b"time": "II"}


def _head_of(content: bytes, place: int) -> _Head | None:
    """Learn the layout of the message's record at a place; None where it is another record."""
    record = _record_in(content, place)
    if record.fields.get(b"op") != _MESSAGE or set(record.fields) != set(_FORMATS):
        return None
    layout, at = "<I", 1
    expected: dict[int, Any] = {0: record.content - place - 2 * _LENGTH.size}
    places = {}
    for name, value in record.fields.items():
        lead = _LENGTH.pack(len(name) + 1 + len(value)) + name + b"="
        layout += f"{len(lead)}s{_FORMATS[name]}"
        expected[at] = lead
        places[name] = at + 1
        at += 3 if name == b"time" else 2
    expected[places[b"op"]] = _MESSAGE
    fixed = itemgetter(*expected)
    return _Head(Struct(f"{layout}I"), fixed, tuple(expected.values()), places[b"conn"], places[b"time"])


def _messages(content: bytes, wanted: dict[int, Channel]) -> Iterator[RawMessage]:
    """Yield the messages of a chunk. The innermost loop of reading: recorders lay out all of them alike."""
    head: _Head | None = None
    place, size = 0, len(content)
    while place < size:
        if head is not None and place + head.struct.size <= size:
            values = head.struct.unpack_from(content, place)
            if head.fixed(values) == head.expected:
                begin = place + head.struct.size
                place = begin + values[-1]
                channel = wanted.get(values[head.connection])
                if channel is not None:
                    seconds, nanoseconds = values[head.time : head.time + 2]
                    yield channel, seconds * _NS_PER_SECOND + nanoseconds, content[begin:place]
                continue
        head = _head_of(content, place)
        if head is None:
            place = _record_in(content, place).end
