"""Stamps and keys in recorded payloads, read without decoding the message."""

from collections.abc import Callable, Hashable
from struct import Struct
from typing import Any, Final, TypeAlias

from syncrelay.cdr import LATEST_STAMP, has_place_for_stamp, read_stamp
from syncrelay.cdr_fields import field_reader, time_reader
from syncrelay.cdr_walk import FieldsOf, UnreadableFieldError
from syncrelay.config import GroupConfig, StampField, StampSource
from syncrelay.errors import BagError
from syncrelay.recordings.bag.definitions import begins_with_header, converter, fields_of, stamp_fields
from syncrelay.recordings.bag.recording import LATEST, Channel, Encoding, RawMessage

ReadStamp: TypeAlias = Callable[[bytes], int | None]
"""From a payload to its stamp in nanoseconds; None if it cannot be read."""

ReadMessage: TypeAlias = Callable[[RawMessage], tuple[int | None, Hashable]]
"""From a message to its stamp and its key; the stamp is None if the group cannot use the message."""

_NS_PER_SECOND: Final = 1_000_000_000
# A ROS 1 Header: uint32 seq, then a time of two uint32, always little-endian.
_ROS1_STAMP: Final = Struct("<4xII")
_ROS1_TIME: Final = Struct("<II")


def message_reader(group: GroupConfig, index: int, channel: Channel) -> ReadMessage:
    """Return what reads the messages of a channel for one input of a group.

    Raises BagError where the channel's type has no such stamp or key.
    """
    topic = group.topics[index]
    stamp_of = stamp_reader(topic.stamp, channel)
    read: ReadMessage = (lambda raw: (raw[1], None)) if stamp_of is None else lambda raw: (stamp_of(raw[2]), None)
    if topic.key is not None:
        read = _with_key(read, value_reader(channel, topic.key))
    # A stamp that was read from a header can also be written to one.
    if group.restamp is None or topic.stamp == "header":
        return read
    latest = LATEST_STAMP if topic.stamp == "receive" else LATEST
    needs_place = channel.encoding is not Encoding.ROS1 and bool(begins_with_header(channel))

    def read_if_it_can_be_restamped(raw: RawMessage) -> tuple[int | None, Hashable]:
        can_be = raw[1] <= latest and (not needs_place or has_place_for_stamp(raw[2]))
        return read(raw) if can_be else (None, None)

    return read_if_it_can_be_restamped


def _with_key(read: ReadMessage, read_key: Callable[[bytes], Any]) -> ReadMessage:
    def read_both(raw: RawMessage) -> tuple[int | None, Hashable]:
        stamp, _ = read(raw)
        key: Hashable = read_key(raw[2])
        return None if key is None else stamp, key

    return read_both


def stamp_reader(source: StampSource, channel: Channel) -> ReadStamp | None:
    """Return what reads the stamp that the file asks for; None for the receive time, which is not in the payload.

    Raises BagError where the channel's type has no such stamp.
    """
    if source == "receive":
        return None
    if isinstance(source, StampField):
        return _in_place(channel, source.field, time_reader)
    if begins_with_header(channel) is False:
        fields = "".join(f"`stamp: {{field: {path}}}`, or " for path in stamp_fields(channel.type, channel.definition))
        raise BagError(
            f"{channel.topic}: {channel.type} does not begin with a std_msgs/msg/Header, where the stamp is looked for:"
            f" write {fields}`stamp: receive` to go by arrival"
        )
    return read_ros1_stamp if channel.encoding is Encoding.ROS1 else read_stamp


def value_reader(channel: Channel, path: str) -> Callable[[bytes], Any]:
    """Return what reads the field at a dotted path: a number, a text, or a time in ns; None if it cannot be read.

    Raises BagError where the type has no such field, or the recording does not define it.
    """
    return _in_place(channel, path, field_reader)


def _in_place(
    channel: Channel, path: str, reader: Callable[[FieldsOf, str, str], Callable[[bytes], Any]]
) -> Callable[[bytes], Any]:
    fields = fields_of(channel)
    if fields is None:
        raise BagError(
            f"{channel.topic}: the recording does not define {channel.type}, so {path} cannot be found in it"
        )
    package, _, name = channel.type.split("/")
    try:
        read = reader(fields, f"{package}/{name}", path)
    except UnreadableFieldError as error:
        raise BagError(f"{channel.topic}: {channel.type} has no field {path} to go by: {error}") from error
    if channel.encoding is not Encoding.ROS1:
        return read
    convert = converter(channel)

    def read_converted(payload: bytes) -> Any:
        converted = convert(payload)
        return None if converted is None else read(converted)

    return read_converted


def read_ros1_stamp(payload: bytes) -> int | None:
    """Return the stamp of the Header that a ROS 1 payload begins with, in nanoseconds; None if it is malformed.

    A stamp after January 2038 counts as malformed too: ROS 2 cannot hold it.
    """
    if len(payload) < _ROS1_STAMP.size:
        return None
    seconds, nanoseconds = _ROS1_STAMP.unpack_from(payload)
    if nanoseconds >= _NS_PER_SECOND:
        return None
    stamp = int(seconds * _NS_PER_SECOND + nanoseconds)
    return stamp if stamp <= LATEST_STAMP else None


def with_ros1_stamp(payload: bytes, stamp: int) -> bytes:
    """Return a ROS 1 payload that `read_ros1_stamp` can read with another stamp, of 0 or more nanoseconds."""
    begin, end = payload[: _ROS1_STAMP.size - _ROS1_TIME.size], payload[_ROS1_STAMP.size :]
    return begin + _ROS1_TIME.pack(*divmod(stamp, _NS_PER_SECOND)) + end
