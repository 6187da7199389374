"""What every kind of recording offers: channels, and their messages in the order in which they were received."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Final, Protocol, TypeAlias

from syncrelay.config.profile import Profile
from syncrelay.printable import printable

# Renamed in ROS 2, with the same fields.
_RENAMED: Final = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}
# A batch is large enough that its cost does not matter, and small enough for memory.
_MESSAGES: Final = 2_000
_BYTES: Final = 4_000_000


class Encoding(Enum):
    """How the payloads of a channel are serialized."""

    CDR = "cdr"
    ROS1 = "ros1"


_ENCODINGS: Final = {each.value: each for each in Encoding}


@dataclass(frozen=True, slots=True)
class Definition:
    """A type's definition as recorded, with those of the types that it is made of.

    `format` is MCAP's name of a schema encoding: ros2msg, ros2idl or ros1msg.
    """

    format: str
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """A topic as one publisher, or several alike ones, recorded it. Two channels are never equal.

    `type` is a full type name (`pkg/msg/Name`), also in a ROS 1 bag. `qos` is what the publishers offered,
    empty where that was not recorded. `type_hash` is the RIHS01 hash of REP 2016, empty if it was not recorded.
    An unknown encoding is kept as it was recorded. Names are made printable: one
    that has to be changed cannot stand in a file anyway.
    """

    id: int
    topic: str
    type: str
    encoding: Encoding | str
    definition: Definition | None = None
    qos: tuple[Profile, ...] = ()
    type_hash: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "topic", printable(topic_name(self.topic)))
        object.__setattr__(self, "type", printable(_full_type_name(self.type)))
        if not isinstance(self.encoding, Encoding):
            object.__setattr__(self, "encoding", _ENCODINGS.get(self.encoding) or printable(self.encoding))


def topic_name(recorded: str) -> str:
    """Return a topic name with its leading slash, which some recorders leave out."""
    return recorded if recorded.startswith("/") else f"/{recorded}"


def _full_type_name(recorded: str) -> str:
    """Return the full type name for ROS 1's `pkg/Name`; a full name is returned unchanged."""
    package, slash, name = recorded.partition("/")
    full = f"{package}/msg/{name}" if slash and "/" not in name else recorded
    return _RENAMED.get(full, full)


RawMessage: TypeAlias = tuple[Channel, int, bytes]
"""Channel, receive time in nanoseconds (0 to LATEST), and payload."""

LATEST: Final = 2**62 - 1
"""The latest receive time, in 2116: ROS 1 has none later, and the difference of two times fits 64 bits."""


class Recording(Protocol):
    """A recording that is open for reading, once from the begin to the end."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What was recorded."""

    @property
    def faults(self) -> list[str]:
        """What could not be read, a sentence each; complete once all messages are read."""

    @property
    def size(self) -> int:
        """How many bytes `batches` goes through, for progress."""

    @property
    def position(self) -> int:
        """How many of these bytes `batches` has gone through."""

    @property
    def begin(self) -> int:
        """When the first message was received in nanoseconds; 0 if there is none."""

    @property
    def end(self) -> int:
        """When the last message was received in nanoseconds; 0 if there is none."""

    def batches(self, wanted: Collection[Channel]) -> Iterator[list[RawMessage]]:
        """Yield the messages of some channels by their receive time; of equal times, as they were written.

        A batch is what is read at a time, and may be empty.
        """

    def close(self) -> None:
        """Close the files."""


def batched(messages: Iterable[RawMessage]) -> Iterator[list[RawMessage]]:
    """Yield single messages in batches."""
    return filled([each] for each in messages)


def filled(batches: Iterable[list[RawMessage]]) -> Iterator[list[RawMessage]]:
    """Yield small batches joined into larger ones; none is empty."""
    held: list[RawMessage] = []
    size = 0
    for batch in batches:
        if not held and len(batch) >= _MESSAGES:
            yield batch
            continue
        held += batch
        size += sum([len(payload) for _, _, payload in batch])
        if len(held) >= _MESSAGES or size >= _BYTES:
            yield held
            held, size = [], 0
    if held:
        yield held
