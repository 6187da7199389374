"""Writes recordings: an MCAP file as rosbag2 writes it, alone or in a rosbag2 folder with metadata."""

import zlib
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from struct import Struct
from types import TracebackType
from typing import Any, BinaryIO, Final, Literal, Self, TypeAlias

import lz4.frame
import yaml
import zstandard
from small_mcap import Chunk, McapWriter, MessageIndex, Opcode

from syncrelay.config.profile import Profile
from syncrelay.output_files import cannot_be_written, local_path, require_new, written_whole
from syncrelay.recordings.bag.qos import write_profile
from syncrelay.recordings.bag.recording import Definition, Encoding

MCAP_SUFFIX: Final = ".mcap"
_PROFILE: Final = "ros2"
Compression: TypeAlias = Literal["zstd", "lz4", "none"]
"""How what is written is packed."""

_CHUNK: Final = 1_048_576
# Opcode, length, channel, sequence, log time, publish time; the payload follows.
_MESSAGE: Final = Struct("<BQHIQQ")
_FIELDS: Final = 22
_MESSAGE_OPCODE: Final = Opcode.MESSAGE.value
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
    """One topic of a new recording; `count` is its number of messages so far.

    `times` and `places` are those of its messages in the chunk that is not full yet.
    """

    channel: int
    topic: str
    type: str
    type_hash: str
    profile: Profile
    count: int = 0
    times: list[int] = field(default_factory=list)
    places: list[int] = field(default_factory=list)


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
            self._opened = opened.pop_all()
        self._compression = compression
        self._chunk: list[bytes] = []
        self._size = 0
        self._outputs: list[Output] = []
        self._schemas: dict[str, int] = {}
        self._begin: int | None = None
        self._end = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        if error is not None:
            return self._opened.__exit__(kind, error, trace)
        with self._opened:
            self._write_chunk()
            self._writer.finish()
            self._file.close()
            if self._folder is not None:
                text = yaml.safe_dump(self._metadata(), sort_keys=False)
                (self._folder / "metadata.yaml").write_text(text, encoding="utf-8")
        return None

    @property
    def count(self) -> int:
        """How many messages have been written."""
        return sum(output.count for output in self._outputs)

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
        length = _FIELDS + len(payload)
        self._chunk += (_MESSAGE.pack(_MESSAGE_OPCODE, length, output.channel, output.count, now, now), payload)
        output.times.append(now)
        output.places.append(self._size)
        output.count += 1
        self._size += _MESSAGE.size - _FIELDS + length
        if self._size >= _CHUNK:
            self._write_chunk()

    def _write_chunk(self) -> None:
        """Write what has come as a chunk, with the index of its messages."""
        there = sorted((output for output in self._outputs if output.times), key=lambda output: output.places[0])
        if not there:
            return
        content = b"".join(self._chunk)
        packed = _PACKED[self._compression](content)
        is_packed = len(content) - len(packed) >= _SAVED * len(content)
        begin, end = min(min(output.times) for output in there), max(max(output.times) for output in there)
        chunk = Chunk(
            compression=self._compression if is_packed else "",
            data=packed if is_packed else content,
            message_start_time=begin,
            message_end_time=end,
            uncompressed_crc=zlib.crc32(content),
            uncompressed_size=len(content),
        )
        indexes = {output.channel: MessageIndex(output.channel, output.times, output.places) for output in there}
        self._writer.add_chunk(chunk, indexes)
        self._begin = begin if self._begin is None else min(begin, self._begin)
        self._end = max(self._end, end)
        for output in there:
            output.times, output.places = [], []
        self._chunk, self._size = [], 0

    def _metadata(self) -> dict[str, Any]:
        begin = self._begin or 0
        span = {
            "starting_time": {"nanoseconds_since_epoch": begin},
            "duration": {"nanoseconds": self._end - begin if self.count else 0},
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
