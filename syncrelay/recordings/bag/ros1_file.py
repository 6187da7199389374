"""ROS 1 bags (format 2.0): by their index, or by one made in a first pass where there is none that can be trusted.

Messages are in chunks.
"""

import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from struct import Struct
from typing import Final

from syncrelay.errors import BagError
from syncrelay.recordings.bag.effort import Effort
from syncrelay.recordings.bag.losses import Losses
from syncrelay.recordings.bag.names import full_type_name, topic_name
from syncrelay.recordings.bag.qos import Profile
from syncrelay.recordings.bag.recording import AFTER_ALL, Channel, Definition, Encoding, RawMessage, is_part
from syncrelay.recordings.bag.ros1_records import (
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    LENGTH,
    MESSAGE,
    UNREADABLE,
    Record,
    field_of,
    fields_of,
    messages,
    record_of,
    records,
    time_of,
    unpacked,
)
from syncrelay.recordings.bag.segments import Segment, extent, read_in_order

MAGIC: Final = b"#ROSBAG V2.0\n"
"""What a bag of this format begins with."""

_PLACE: Final = Struct("<Q")
_LATCHED: Final = (Profile(durability="transient_local"),)


class Ros1File:
    """One ROS 1 bag, opened for reading; see Recording."""

    def __init__(self, path: Path, name: str) -> None:
        """Open a file that messages call `name`; raises BagError where it is encrypted."""
        self._file = path.open("rb")
        self._losses = Losses(name)
        self.size = os.fstat(self._file.fileno()).st_size
        self.position = 0
        self._effort = Effort()
        self._by_id: dict[int, Channel] = {}
        self._segments: list[Segment] = []
        if self._is_encrypted():
            self._file.close()
            raise BagError(f"{name}: is encrypted, which is not supported")
        if not self._read_index():
            self._scan()
        self.channels = tuple(self._by_id.values())
        self.begin, self.end = extent(self._segments)

    @property
    def faults(self) -> list[str]:
        """See Recording."""
        return self._losses.sentences

    def batches(
        self, wanted: Collection[Channel], *, begin: int = 0, end: int = AFTER_ALL
    ) -> Iterator[list[RawMessage]]:
        """See Recording."""
        among = frozenset(wanted)
        chosen = {number: channel if channel in among else None for number, channel in self._by_id.items()}
        read = partial(self._read, channels=chosen)
        for segment, found in read_in_order(self._segments, read, self._losses, begin=begin, end=end):
            self.position += segment.size
            yield found
        if not is_part(begin, end):
            self.position = self.size

    def close(self) -> None:
        """See Recording."""
        self._file.close()

    def _is_encrypted(self) -> bool:
        with suppress(*UNREADABLE):
            return bool(self._record_at(len(MAGIC)).fields.get(b"encryptor"))
        return False

    def _read_index(self) -> bool:
        """Take channels and chunks from the end of the file; False where there is no such end, or it tells a lie."""
        infos = []
        try:
            header = self._record_at(len(MAGIC)).fields
            (place,) = _PLACE.unpack(field_of(header, b"index_pos"))
            (chunks,) = LENGTH.unpack(field_of(header, b"chunk_count"))
            if not place or place > self.size:
                return False
            while place < self.size:
                record = self._record_at(place)
                if record.fields.get(b"op") == CONNECTION:
                    self._connect(record.fields, self._content(record))
                elif record.fields.get(b"op") == CHUNK_INFO and LENGTH.unpack(field_of(record.fields, b"count"))[0]:
                    infos.append(_segment(record.fields))
                place = record.end
        except UNREADABLE:
            return False
        offsets = sorted(each.offset for each in infos)
        ends = dict(zip(offsets, [*offsets, self.size][1:], strict=True))
        self._segments = [replace(each, size=ends[each.offset] - each.offset) for each in infos]
        return len(ends) == chunks and all(each.size > 0 and each.begin <= each.end for each in self._segments)

    def _scan(self) -> None:
        """Find channels and chunks by going through the file to its end, or as far as it can be read."""
        self._by_id.clear()
        self._segments.clear()
        place = len(MAGIC)
        while place < self.size:
            try:
                record = self._record_at(place)
            except UNREADABLE:
                self._losses.cut_off(place, self.size)
                return
            self._note(place, record)
            place = record.end
        if not self._has_index_place():
            self._losses.not_closed()

    def _has_index_place(self) -> bool:
        """Tell whether the file goes as far as its header says that the index is; that is 0 until it is closed."""
        with suppress(*UNREADABLE):
            (place,) = _PLACE.unpack(field_of(self._record_at(len(MAGIC)).fields, b"index_pos"))
            return bool(0 < place <= self.size)
        return False

    def _note(self, place: int, record: Record) -> None:
        """Take in what a record of the file says."""
        op = record.fields.get(b"op")
        try:
            if op == CHUNK:
                self._note_chunk(place, record)
            elif op == CONNECTION:
                self._connect(record.fields, self._content(record))
        except UNREADABLE as fault:
            self._losses.damaged(f"the {'chunk' if op == CHUNK else 'connection'} at byte {place}", fault)

    def _note_chunk(self, place: int, record: Record) -> None:
        content = unpacked(record.fields, self._content(record), self._effort)
        times = []
        # Where its records end too soon is said when its messages are read.
        with suppress(*UNREADABLE):
            for each in records(content):
                if each.fields.get(b"op") == CONNECTION:
                    self._connect_in(place, each.fields, content[each.content : each.end])
                elif each.fields.get(b"op") == MESSAGE:
                    times.append(time_of(field_of(each.fields, b"time")))
        if times:
            self._effort.found_message()
            self._segments.append(Segment(place, record.end - place, min(times), max(times)))

    def _read(self, segment: Segment, channels: dict[int, Channel | None]) -> list[RawMessage]:
        found: list[RawMessage] = []
        try:
            record = self._record_at(segment.offset)
            found.extend(messages(unpacked(record.fields, self._content(record), self._effort), channels))
            self._effort.found_message()
        except UNREADABLE as fault:
            self._losses.damaged(f"the chunk at byte {segment.offset}", fault, read=len(found))
        return found

    def _record_at(self, place: int) -> Record:
        """Read the header of a record that the file has all of; raises one of UNREADABLE where it has not."""
        header = place + LENGTH.size
        begin = header + self._length_at(place) + LENGTH.size
        end = begin + self._length_at(begin - LENGTH.size)
        if end > self.size:
            raise EOFError("it ends past the end of the file")
        return record_of(self._bytes(header, begin - LENGTH.size - header), begin, end)

    def _length_at(self, place: int) -> int:
        (length,) = LENGTH.unpack(self._bytes(place, LENGTH.size))
        return int(length)

    def _content(self, record: Record) -> bytes:
        return self._bytes(record.content, record.end - record.content)

    def _bytes(self, place: int, size: int) -> bytes:
        """Read bytes that the file has, or a length where it may have ended."""
        self._file.seek(place)
        return self._file.read(size)

    def _connect_in(self, chunk: int, fields: Mapping[bytes, bytes], content: bytes) -> None:
        try:
            self._connect(fields, content)
        except UNREADABLE as fault:
            self._losses.damaged(f"a connection in the chunk at byte {chunk}", fault)

    def _connect(self, fields: Mapping[bytes, bytes], content: bytes) -> None:
        (number,) = LENGTH.unpack(field_of(fields, b"conn"))
        if number in self._by_id:
            return
        about = fields_of(content)
        self._by_id[number] = Channel(
            number,
            topic_name(field_of(fields, b"topic").decode()),
            full_type_name(field_of(about, b"type").decode()),
            Encoding.ROS1,
            Definition("ros1msg", field_of(about, b"message_definition").decode(errors="replace")),
            _LATCHED if about.get(b"latching") == b"1" else (),
        )


def open_ros1(path: Path, name: str) -> Ros1File:
    """Open a ROS 1 bag; raises BagError where nothing of it can be read."""
    file = Ros1File(path, name)
    if not file.channels:
        file.close()
        raise BagError(f"{name}: no message can be read{': ' + file.faults[0] if file.faults else ', it is empty'}")
    return file


def _segment(info: Mapping[bytes, bytes]) -> Segment:
    (place,) = _PLACE.unpack(field_of(info, b"chunk_pos"))
    return Segment(place, 0, time_of(field_of(info, b"start_time")), time_of(field_of(info, b"end_time")))
