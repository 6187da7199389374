"""Records of MCAP files (specification: mcap.dev/spec), each parsed within its own bytes."""

import zlib
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from struct import Struct, error
from typing import Final, Protocol, TypeVar

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk
from zstandard import ZstdError

from syncrelay.recordings.bag.effort import Effort
from syncrelay.recordings.bag.losses import STRAY
from syncrelay.recordings.bag.recording import Channel, RawMessage
from syncrelay.recordings.bag.unpacking import plain, unlz4, unzstd

RECORD: Final = Struct("<BQ")
"""What every record begins with: its opcode, and the length of what follows."""

# Opcode, length, channel id, (sequence,) log time (, publish time); the payload follows.
_MESSAGE: Final = Struct("<BQH4xQ8x")
MESSAGE_FIELDS: Final = _MESSAGE.size - RECORD.size
"""The least length of a message."""

UNREADABLE: Final = (McapError, ZstdError, RuntimeError, error, ValueError, EOFError, OSError, MemoryError)
"""What damaged bytes raise."""

_BEHIND: Final = "a record in it ends behind it"
_NO_RECORD: Final = "there is no record where one should begin"
_UNPACKERS: Final[Mapping[str, Callable[[bytes, Effort], bytes]]] = {"": plain, "lz4": unlz4, "zstd": unzstd}
_Parsed_co = TypeVar("_Parsed_co", covariant=True)


class Kind(Protocol[_Parsed_co]):
    """A class of mcap.records."""

    @staticmethod
    def read(stream: ReadDataStream) -> _Parsed_co: ...


class _Content(BytesIO):
    """The content of a record; reading past its end, which mcap does not notice, raises EOFError."""

    def __init__(self, content: bytes) -> None:
        super().__init__(content)
        # Not from getbuffer(), which would copy the content.
        self._size = len(content)

    def read(self, size: int, /) -> bytes:  # type: ignore[override]  # mcap always says how many
        if size > self._size - self.tell():
            raise EOFError("a length in it points past its end")
        return super().read(size)


def parsed(kind: Kind[_Parsed_co], content: bytes) -> _Parsed_co:
    """Return a record of a kind, parsed from what follows its length; raises one of UNREADABLE."""
    return kind.read(ReadDataStream(_Content(content)))


def require_record(opcode: int) -> None:
    """Raise ValueError for opcode 0, which no record has: after a loss of power a file may end in zeros."""
    if not opcode:
        raise ValueError(_NO_RECORD)


def unpacked(chunk: Chunk, effort: Effort) -> bytes:
    """Return the records of a chunk; raises one of UNREADABLE where it is damaged."""
    unpack = _UNPACKERS.get(chunk.compression)
    if unpack is None:
        raise ValueError(f"it is compressed with {chunk.compression!r}, expected lz4 or zstd")
    content = unpack(chunk.data, effort)
    # 0 means that there is no checksum.
    if chunk.uncompressed_crc not in (0, zlib.crc32(content)):
        raise ValueError("its checksum is wrong")
    return content


def records(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, begin and end of each record's content; raises one of UNREADABLE at a damaged one."""
    place = 0
    while place < len(content):
        opcode, length = RECORD.unpack_from(content, place)
        require_record(opcode)
        begin = place + RECORD.size
        place = begin + length
        if place > len(content):
            raise ValueError(_BEHIND)
        yield opcode, begin, place


def add_messages(
    found: list[RawMessage], content: bytes, channels: Mapping[int, Channel | None], effort: Effort
) -> None:
    """Add the messages in a run of records to `found`, except those of channels that are None.

    A message of an unknown channel becomes STRAY. Raises one of UNREADABLE at damage; all before it is added.
    The innermost loop of reading: half a microsecond each.
    """
    unpack, begin_payload, message, least = _MESSAGE.unpack_from, _MESSAGE.size, Opcode.MESSAGE.value, MESSAGE_FIELDS
    add = found.append
    place, size, others = 0, len(content), 0
    while place < size:
        if content[place] != message:
            require_record(content[place])
            effort.pass_record()
            record = RECORD.size + RECORD.unpack_from(content, place)[1]
            place += record
            others += record
            continue
        _, length, number, time = unpack(content, place)
        end = place + RECORD.size + length
        if end > size:
            raise ValueError("a message in it ends past its end")
        if number not in channels or length < least:
            add(STRAY)
        elif (channel := channels[number]) is not None:
            add((channel, time, content[place + begin_payload : end]))
        place = end
    if place > size:
        raise ValueError(_BEHIND)
    if others < size:
        effort.found_message()
