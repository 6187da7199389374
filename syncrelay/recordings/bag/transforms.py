"""The transforms of a recording, and the frames of its messages."""

from array import array
from collections.abc import Callable, Iterator, Sequence
from sys import intern
from typing import Final, TypeAlias

from syncrelay.frames import TF_TYPE, Edge, read_frame, read_ros1_frame, read_transforms
from syncrelay.recordings.bag.definitions import begins_with_header, converter
from syncrelay.recordings.bag.recording import Channel, Encoding, RawMessage, Recording

ReadFrame: TypeAlias = Callable[[RawMessage], str | None]
"""From a message to the frame_id of its header; None for a message without one."""

_TOPICS: Final = {"/tf": False, "/tf_static": True}
# tf2's name of the type, and that of the tf before it; both are laid out alike.
_TYPES: Final = (TF_TYPE, "tf/msg/tfMessage")


def transform_channels(recording: Recording) -> list[Channel]:
    """Return the channels that hold transforms."""
    return [
        channel
        for channel in recording.channels
        if channel.topic in _TOPICS and channel.type in _TYPES and isinstance(channel.encoding, Encoding)
    ]


class TransformReader:
    """Reads the transforms of these channels."""

    def __init__(self, channels: Sequence[Channel]) -> None:
        """Raises BagError for a definition of ROS 1 that cannot be read."""
        self._converters = {each: converter(each) for each in channels if each.encoding is Encoding.ROS1}

    def read(self, raw: RawMessage) -> list[Edge]:
        """Return the transforms of a message."""
        channel, _, payload = raw
        convert = self._converters.get(channel)
        converted = payload if convert is None else convert(payload)
        return [] if converted is None else read_transforms(converted, is_static=_TOPICS[channel.topic])


def frame_reader() -> ReadFrame:
    """Return what reads the frames of messages of any channels."""
    readers: dict[Channel, Callable[[bytes], str] | None] = {}

    def read(raw: RawMessage) -> str | None:
        channel, _, payload = raw
        if channel not in readers:
            of_header = read_ros1_frame if channel.encoding is Encoding.ROS1 else read_frame
            readers[channel] = of_header if begins_with_header(channel) else None
        read_it = readers[channel]
        # Few frames are in many messages.
        return None if read_it is None else intern(read_it(payload))

    return read


class RecordedTransforms:
    """The transforms of a whole recording, by their times of receipt."""

    def __init__(self) -> None:
        self._edges: list[tuple[str, str, bool]] = []
        self._numbers: dict[tuple[str, str, bool], int] = {}
        self._received, self._stamps, self._of = array("q"), array("q"), array("q")

    def add(self, edges: Sequence[Edge], received: int) -> None:
        """Take transforms that were received together, no earlier than those before."""
        for edge in edges:
            key = (edge.parent, edge.child, edge.is_static)
            number = self._numbers.setdefault(key, len(self._edges))
            if number == len(self._edges):
                self._edges.append(key)
            self._received.append(received)
            self._stamps.append(edge.stamp)
            self._of.append(number)

    def __iter__(self) -> Iterator[tuple[int, Edge]]:
        """Yield when each transform was received, and the transform."""
        for received, stamp, number in zip(self._received, self._stamps, self._of, strict=True):
            parent, child, is_static = self._edges[number]
            yield received, Edge(parent, child, stamp, is_static)
