"""Writes recordings: an MCAP file as rosbag2 writes it, alone or in a rosbag2 folder with metadata."""

import zlib
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from struct import Struct
from types import TracebackType
from typing import Any, BinaryIO, Final, Literal, Self, TypeAlias

import lz4.frame
import numpy as np
import yaml
import zstandard
from small_mcap import Chunk, McapWriter, MessageIndex, Opcode

from syncrelay.config.profile import Profile
from syncrelay.output_files import cannot_be_written, local_path, require_new, written_whole
from syncrelay.recordings.bag.qos import write_profile
from syncrelay.recordings.bag.recording import LATEST, Definition, Encoding

MCAP_SUFFIX: Final = ".mcap"
_PROFILE: Final = "ros2"
Compression: TypeAlias = Literal["zstd", "lz4", "none"]
"""How what is written is packed."""

_CHUNK: Final = 1_048_576
# The payload follows; `length` counts what stands behind it.
_MESSAGE: Final = np.dtype(
    [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("logged", "<u8"), ("sent", "<u8")]
)
_FIELDS: Final = 22
# Of the index of a channel's messages: channel and size, then a time and a place for each.
_INDEX: Final = Struct("<HI")
_ENTRY: Final = np.dtype([("time", "<u8"), ("place", "<u8")])
# Chunks that are packed while the next is filled: two, as a packer has to wait for its turn at Python.
_MOST_PACKING: Final = 2
# What saves less than this share is not worth the time that unpacking takes.
_SAVED: Final = 0.05
_PACKED: Final[Mapping[Compression, Callable[[bytes], bytes]]] = {
    "zstd": lambda content: zstandard.ZstdCompressor().compress(content),
    "lz4": lz4.frame.compress,
    "none": bytes,
}

# The version of rosbag2's metadata that Jazzy writes.
_METADATA_VERSION: Final = 9


@dataclass(slots=True)
class Output:
    """One topic of a new recording; `count` is its number of messages in chunks so far."""

    channel: int
    topic: str
    type: str
    type_hash: str
    profile: Profile
    count: int = 0


class McapOutput:
    """Writes CDR messages; a context manager. After an error there is no recording."""

    def __init__(self, place: Path | str, *, compression: Compression = "zstd") -> None:
        """Start a file (the name ends in .mcap) or a folder, at a path or a URL; raises OutputError if it exists."""
        is_file = str(place).endswith(MCAP_SUFFIX)
        with ExitStack() as opened:
            if not is_file and (path := local_path(place)) is not None:
                try:
                    path.parent.mkdir(parents=True, exist_ok=True)
                except OSError as error:
                    raise cannot_be_written(path, error) from error
            require_new(place)
            scratch = opened.enter_context(written_whole(place))
            self._folder = None if is_file else scratch
            if self._folder is not None:
                self._folder.mkdir()
            self._path = scratch if is_file else scratch / f"{scratch.name}_0{MCAP_SUFFIX}"
            self._file = self._path.open("xb")
            opened.callback(_close, self._file)
            self._writer = McapWriter(self._file, use_chunking=False)
            self._writer.start(_PROFILE)
            self._packers = ThreadPoolExecutor(_MOST_PACKING)
            opened.callback(self._packers.shutdown, cancel_futures=True)
            self._opened = opened.pop_all()
        self._compression: Final = compression
        self._packing: deque[tuple[Future[Chunk], dict[int, MessageIndex]]] = deque()
        # The messages of the chunk that is not full yet.
        self._channels: list[int] = []
        self._times: list[int] = []
        self._payloads: list[bytes] = []
        self._size = 0
        self._outputs: list[Output] = []
        self._schemas: dict[str, int] = {}
        self._begin = LATEST
        self._end = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        if error is not None:
            return self._opened.__exit__(kind, error, trace)
        with self._opened:
            if self._payloads:
                self._pack_chunk()
            self._write_packed(0)
            self._writer.finish()
            self._file.close()
            if self._folder is not None:
                text = yaml.safe_dump(self._metadata(), sort_keys=False)
                (self._folder / "metadata.yaml").write_text(text, encoding="utf-8")
        return None

    @property
    def count(self) -> int:
        """How many messages have been written."""
        return sum(output.count for output in self._outputs) + len(self._payloads)

    def add(self, topic: str, type_name: str, definition: Definition | None, type_hash: str, qos: Profile) -> Output:
        """Add a topic."""
        if type_name not in self._schemas:
            text = definition.text.encode() if definition else b""
            encoding = definition.format if definition else ""
            self._schemas[type_name] = len(self._schemas) + 1
            self._writer.add_schema(self._schemas[type_name], type_name, encoding, text)
        profiles = yaml.safe_dump([write_profile(qos)], sort_keys=False).strip()
        about = {"offered_qos_profiles": profiles, "topic_type_hash": type_hash}
        number = len(self._outputs) + 1
        self._writer.add_channel(number, topic, Encoding.CDR.value, self._schemas[type_name], about)
        output = Output(number, topic, type_name, type_hash, qos)
        self._outputs.append(output)
        return output

    def write(self, output: Output, payload: bytes, now: int) -> None:
        """Write a message with the receive time `now`, in nanoseconds."""
        self.write_all([output.channel], [payload], [now])

    def write_all(self, channels: Sequence[int], payloads: Sequence[bytes], times: Sequence[int]) -> None:
        """Write messages in their order, each with its output's channel and its receive time."""
        self._channels += channels
        self._payloads += payloads
        self._times += times
        self._size += sum(map(len, payloads)) + _MESSAGE.itemsize * len(payloads)
        while self._size >= _CHUNK:
            self._pack_chunk()

    def _pack_chunk(self) -> None:
        """Have the first messages packed as a chunk, with the index of each channel, and write what is packed."""
        sizes = np.fromiter(map(len, self._payloads), dtype=np.uint64)
        ends = np.cumsum(sizes + _MESSAGE.itemsize)
        count = int(np.searchsorted(ends[:-1], _CHUNK)) + 1
        payloads, sizes, ends = self._payloads[:count], sizes[:count], ends[:count]
        channels = np.array(self._channels[:count], dtype=np.uint16)
        times = np.array(self._times[:count], dtype=np.uint64)
        del self._payloads[:count], self._channels[:count], self._times[:count]
        self._size -= int(ends[-1])
        heads, entries = np.empty(count, _MESSAGE), np.zeros(count, _ENTRY)
        heads["opcode"], heads["length"], heads["channel"] = Opcode.MESSAGE.value, sizes + _FIELDS, channels
        heads["logged"] = heads["sent"] = entries["time"] = times
        entries["place"][1:] = ends[:-1]
        indexes = {}
        for channel in dict.fromkeys(channels.tolist()):
            among, output = np.flatnonzero(channels == channel), self._outputs[channel - 1]
            heads["sequence"][among] = np.arange(output.count, output.count + len(among))
            output.count += len(among)
            head = _INDEX.pack(channel, _ENTRY.itemsize * len(among))
            indexes[channel] = MessageIndex(channel, raw_content=head + entries[among].tobytes())
        parts = payloads * 2
        parts[::2], parts[1::2] = heads.view(f"V{_MESSAGE.itemsize}").tolist(), payloads
        content = b"".join(parts)
        span = int(times.min()), int(times.max())
        self._begin, self._end = min(self._begin, span[0]), max(self._end, span[1])
        self._packing.append((self._packers.submit(_packed, content, self._compression, span), indexes))
        self._write_packed(_MOST_PACKING)

    def _write_packed(self, most: int) -> None:
        """Write the chunks that were packed first, until so many are left."""
        while len(self._packing) > most:
            packed, indexes = self._packing.popleft()
            self._writer.add_chunk(packed.result(), indexes)

    def _metadata(self) -> dict[str, Any]:
        # Without a message, 0.
        begin = min(self._begin, self._end)
        span = {
            "starting_time": {"nanoseconds_since_epoch": begin},
            "duration": {"nanoseconds": self._end - begin},
            "message_count": self.count,
        }
        about = {
            "version": _METADATA_VERSION,
            "storage_identifier": "mcap",
            **span,
            "topics_with_message_count": [_topic_metadata(output) for output in self._outputs],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self._path.name],
            "files": [{"path": self._path.name, **span}],
            "custom_data": None,
            "ros_distro": "jazzy",
        }
        return {"rosbag2_bagfile_information": about}


def _packed(content: bytes, compression: Compression, span: tuple[int, int]) -> Chunk:
    """Return a chunk of messages. On a packer's thread: compression and checksum let other threads run."""
    packed = _PACKED[compression](content)
    is_packed = len(content) - len(packed) >= _SAVED * len(content)
    return Chunk(
        compression=compression if is_packed else "",
        data=packed if is_packed else content,
        message_start_time=span[0],
        message_end_time=span[1],
        uncompressed_crc=zlib.crc32(content),
        uncompressed_size=len(content),
    )


def _close(file: BinaryIO) -> None:
    # On a full disk, closing fails once more.
    with suppress(OSError):
        file.close()


def _topic_metadata(output: Output) -> dict[str, Any]:
    about = {
        "name": output.topic,
        "type": output.type,
        "serialization_format": Encoding.CDR.value,
        "offered_qos_profiles": [write_profile(output.profile)],
        "type_description_hash": output.type_hash,
    }
    return {"topic_metadata": about, "message_count": output.count}
