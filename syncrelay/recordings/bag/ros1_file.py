"""ROS 1 bags (format 2.0), read by rosbags through the index that a closed bag ends with."""

from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path
from typing import Final

from rosbags.interfaces import Connection, ConnectionExtRosbag1
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.rosbag1.reader import IndexData, decompressors

from syncrelay.config.profile import Profile
from syncrelay.errors import BagError
from syncrelay.recordings.bag.effort import Effort
from syncrelay.recordings.bag.losses import Losses
from syncrelay.recordings.bag.recording import Channel, Definition, Encoding, RawMessage, batched
from syncrelay.recordings.bag.unpacking import unbz2, unlz4

MAGIC: Final = b"#ROSBAG V2.0\n"
"""What a bag of this format begins with."""

_LATCHED: Final = (Profile(durability="transient_local"),)
# rosbags keeps one unpacked chunk, and unpacks anew for each message where chunks overlap in time.
_HELD_CHUNKS: Final = 4
_UNPACKERS: Final = {decompressors["bz2"]: unbz2, decompressors["lz4"]: unlz4}


class Ros1File:
    """One ROS 1 bag, opened for reading; see Recording."""

    def __init__(self, path: Path, name: str) -> None:
        """Open a file that messages call `name`; raises BagError where it is encrypted or its index cannot be read."""
        self._losses = Losses(name)
        self.size = path.stat().st_size
        self.position = 0
        self._reader = _BoundedReader(path)
        try:
            self._reader.open()
        except Exception as error:
            raise BagError(f"{name}: {_why_not_opened(error, name)}") from error
        unpacking = _Unpacking()
        for place, chunk in self._reader.chunks.items():
            if (unpack := _UNPACKERS.get(chunk.decompressor)) is not None:
                bounded = partial(unpacking.unpacked, place, unpack)
                self._reader.chunks[place] = chunk._replace(decompressor=bounded)
        self._by_id = {each.id: _channel(each) for each in self._reader.connections}
        self.channels = tuple(self._by_id.values())
        times = [index[end].time for index in self._reader.indexes.values() if index for end in (0, -1)]
        self.begin, self.end = min(times, default=0), max(times, default=0)

    @property
    def faults(self) -> list[str]:
        """See Recording."""
        return self._losses.sentences

    def batches(self, wanted: Collection[Channel]) -> Iterator[list[RawMessage]]:
        """See Recording."""
        return batched(self._messages(frozenset(wanted)))

    def close(self) -> None:
        """See Recording."""
        if self._reader.bio is not None:
            self._reader.close()

    def _messages(self, wanted: Collection[Channel]) -> Iterator[RawMessage]:
        chosen = [each for each in self._reader.connections if self._by_id[each.id] in wanted]
        try:
            # rosbags takes no connections for all of them.
            for connection, time, payload in self._reader.messages(chosen) if chosen else ():
                self.position = max(self.position, self._reader.current_chunk[0])
                yield self._by_id[connection.id], time, payload
        except Exception as error:  # noqa: BLE001  as in open()
            self._losses.say(f"damaged; read as far as possible: {_reason(error)}")
        self.position = self.size


class _BoundedReader(Reader):
    """rosbags' reader, which has no bound for an index that many chunks share."""

    _indexed = 0

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """See Reader; raises ReaderError once more was read of the index than the file holds."""
        assert self.bio is not None  # noqa: S101  for mypy: it is called by open() alone
        begin = self.bio.tell()
        super().read_index_data(pos, indexes)
        self._indexed += self.bio.tell() - begin
        if self._indexed > self.path.stat().st_size:
            raise ReaderError("it is larger than the file")


class _Unpacking:
    """Unpacks chunks within bounds, and keeps the last few of them."""

    def __init__(self) -> None:
        self._effort = Effort()
        self._held: dict[int, bytes] = {}
        self._seen: set[int] = set()

    def unpacked(self, place: int, unpack: Callable[[bytes, Effort], bytes], packed: bytes) -> bytes:
        """Return the content of the chunk at a place; raises whatever `unpack` does."""
        content = self._held.get(place)
        if content is None:
            # A chunk is unpacked because the index leads to a message in it. A second time it is no new one.
            if place not in self._seen:
                self._effort.found_message()
            self._seen.add(place)
            self._held[place] = content = unpack(packed, self._effort)
            if len(self._held) > _HELD_CHUNKS:
                del self._held[next(iter(self._held))]
        return content


def _channel(connection: Connection) -> Channel:
    about = connection.ext
    is_latched = isinstance(about, ConnectionExtRosbag1) and about.latching == 1
    return Channel(
        connection.id,
        connection.topic,
        connection.msgtype,
        Encoding.ROS1,
        Definition("ros1msg", connection.msgdef.data),
        _LATCHED if is_latched else (),
    )


def _why_not_opened(error: Exception, name: str) -> str:
    if "encryption" in str(error):
        return "is encrypted, which is not supported"
    return (
        f"its index cannot be read: {_reason(error)}. A bag that was not closed, is cut off or damaged needs a new one:"
        f" run `rosbag reindex {name}` of ROS 1, then read it again"
    )


def _reason(error: BaseException) -> str:
    if isinstance(error, MemoryError):
        return "there is not enough memory"
    # Of an index, rosbags raises an error that quotes the arguments of its own first one.
    error = error.__context__ if isinstance(error.__context__, ReaderError) else error
    # Its other exceptions say nothing to a reader: failed assertions, keys, offsets.
    has_words = isinstance(error, ReaderError | EOFError | OSError | RuntimeError | ValueError)
    has_words &= not isinstance(error, UnicodeError)
    why = getattr(error, "strerror", None) or str(error)
    return why.rstrip(".") if has_words and why else "the records do not fit together"
