"""Records of ROS 1 bags: a header of named fields and its content, each with a uint32 length before it."""

from collections.abc import Callable, Iterator, Mapping
from operator import itemgetter
from struct import Struct, error
from typing import Any, Final, NamedTuple

from syncrelay.recordings.bag.effort import Effort
from syncrelay.recordings.bag.losses import STRAY
from syncrelay.recordings.bag.recording import Channel, RawMessage
from syncrelay.recordings.bag.unpacking import plain, unbz2, unlz4

MESSAGE, CHUNK, CHUNK_INFO, CONNECTION = (bytes([op]) for op in (2, 5, 6, 7))
"""What `op` is of the records that are read."""

LENGTH: Final = Struct("<I")
UNREADABLE: Final = (error, ValueError, EOFError, OSError, RuntimeError, MemoryError)
"""What bytes raise that are not what they should be."""

_TIME: Final = Struct("<II")
_NS_PER_SECOND: Final = 1_000_000_000
_BEHIND: Final = "a record in it ends behind it"
_UNPACKERS: Final[Mapping[bytes, Callable[[bytes, Effort], bytes]]] = {b"none": plain, b"bz2": unbz2, b"lz4": unlz4}


class Record(NamedTuple):
    """A record: its fields, where its content begins, and where it ends."""

    fields: Mapping[bytes, bytes]
    content: int
    end: int


def record_of(header: bytes, content: int, end: int) -> Record:
    """Return the record of a header; raises one of UNREADABLE where that is none, as a tail of zeros is."""
    fields = fields_of(header)
    if b"op" not in fields:
        raise ValueError("there is no record where one should begin")
    return Record(fields, content, end)


def time_of(value: bytes) -> int:
    """Return the nanoseconds of a time; raises struct.error where it is none."""
    seconds, nanoseconds = _TIME.unpack(value)
    return int(seconds * _NS_PER_SECOND + nanoseconds)


def unpacked(fields: Mapping[bytes, bytes], content: bytes, effort: Effort) -> bytes:
    """Return the records of a chunk; raises one of UNREADABLE where it is none, or is damaged."""
    if fields.get(b"op") != CHUNK:
        raise ValueError("it does not match the index")
    compression = field_of(fields, b"compression")
    unpack = _UNPACKERS.get(compression)
    if unpack is None:
        raise ValueError(f"it is compressed with {compression.decode(errors='replace')!r}, expected bz2 or lz4")
    return unpack(content, effort)


def fields_of(header: bytes) -> dict[bytes, bytes]:
    """Return the fields of a header by name; raises one of UNREADABLE where it holds anything else."""
    fields = {}
    place = 0
    while place < len(header):
        (size,) = LENGTH.unpack_from(header, place)
        begin = place + LENGTH.size
        place = begin + size
        if place > len(header):
            raise ValueError("a field ends past its header")
        name, _, value = header[begin:place].partition(b"=")
        fields[name] = value
    return fields


def field_of(fields: Mapping[bytes, bytes], name: bytes) -> bytes:
    """Return a field of a header; raises ValueError where it is not there."""
    value = fields.get(name)
    if value is None:
        raise ValueError(f"it has no {name.decode()}")
    return value


def records(content: bytes) -> Iterator[Record]:
    """Yield the records of a chunk; raises one of UNREADABLE where they end."""
    place = 0
    while place < len(content):
        record = _record_in(content, place)
        yield record
        place = record.end


def _record_in(content: bytes, place: int) -> Record:
    (header_size,) = LENGTH.unpack_from(content, place)
    header = content[place + LENGTH.size : place + LENGTH.size + header_size]
    behind = place + LENGTH.size + header_size
    (size,) = LENGTH.unpack_from(content, behind)
    begin = behind + LENGTH.size
    if begin + size > len(content):
        raise ValueError(_BEHIND)
    return record_of(header, begin, begin + size)


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
_SIZES: Final = {b"op": 1, b"conn": 4, b"time": 8}


def _head_of(record: Record, place: int) -> _Head | None:
    """Learn the layout of the message's record that stands at a place; None where it is not as others are."""
    if {name: len(value) for name, value in record.fields.items()} != _SIZES:
        return None
    layout, at = "<I", 1
    expected: dict[int, Any] = {0: record.content - place - 2 * LENGTH.size}
    places = {}
    for name in record.fields:
        lead = LENGTH.pack(len(name) + 1 + _SIZES[name]) + name + b"="
        layout += f"{len(lead)}s{_FORMATS[name]}"
        expected[at] = lead
        places[name] = at + 1
        at += 3 if name == b"time" else 2
    expected[places[b"op"]] = MESSAGE
    struct = Struct(f"{layout}I")
    if struct.size != record.content - place:
        return None
    return _Head(struct, itemgetter(*expected), tuple(expected.values()), places[b"conn"], places[b"time"])


def messages(content: bytes, channels: Mapping[int, Channel | None]) -> Iterator[RawMessage]:
    """Yield the messages of a chunk that are of one of the channels by number, but of those that are None.

    Those of no channel are STRAY. Raises one of UNREADABLE where the records end. The innermost loop of reading:
    recorders lay out all messages alike.
    """
    head: _Head | None = None
    place, size = 0, len(content)
    while place < size:
        if head is not None and place + head.struct.size <= size:
            values = head.struct.unpack_from(content, place)
            if head.fixed(values) == head.expected:
                begin = place + head.struct.size
                place = begin + values[-1]
                if place > size:
                    raise ValueError(_BEHIND)
                number = values[head.connection]
                if number not in channels:
                    yield STRAY
                elif (channel := channels[number]) is not None:
                    seconds, nanoseconds = values[head.time : head.time + 2]
                    yield channel, seconds * _NS_PER_SECOND + nanoseconds, content[begin:place]
                continue
        record = _record_in(content, place)
        if record.fields.get(b"op") == MESSAGE:
            head = _head_of(record, place)
            (number,) = LENGTH.unpack(field_of(record.fields, b"conn"))
            if number not in channels:
                yield STRAY
            elif (channel := channels[number]) is not None:
                yield channel, time_of(field_of(record.fields, b"time")), content[record.content : record.end]
        place = record.end
