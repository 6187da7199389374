"""Stamps and keys in recorded payloads, read in place where that can be done."""

from collections.abc import Callable
from struct import Struct
from typing import Any, Final, TypeAlias

from syncrelay.bag.definitions import begins_with_header, converter, fields_of
from syncrelay.bag.recording import Channel, Encoding
from syncrelay.cdr import LATEST_STAMP, read_stamp
from syncrelay.cdr_fields import FieldsOf, UnreadableFieldError, field_reader, time_reader
from syncrelay.config import StampField, StampSource
from syncrelay.errors import BagError

ReadStamp: TypeAlias = Callable[[bytes], int | None]
"""From a payload to its stamp in nanoseconds; None where none can be read."""

_NS_PER_SECOND: Final = 1_000_000_000
# A ROS 1 Header begins with uint32 seq; the time behind it is two uint32, always little-endian.
_ROS1_STAMP: Final = Struct("<4xII")


def stamp_reader(source: StampSource, channel: Channel) -> ReadStamp | None:
    """Return what reads the stamp that the file asks for; None for the receive time, which no payload holds.

    Raises BagError where the channel's type has no such stamp.
    """
    if source == "receive":
        return None
    if isinstance(source, StampField):
        return _in_place(channel, source.field, time_reader)
    if begins_with_header(channel) is False:
        raise BagError(
            f"{channel.topic}: {channel.type} does not begin with a std_msgs/msg/Header, where the stamp is looked for:"
            " write `stamp: receive` to go by arrival"
        )
    return read_ros1_stamp if channel.encoding is Encoding.ROS1 else read_stamp


def value_reader(channel: Channel, path: str) -> Callable[[bytes], Any]:
    """Return what reads the field at a dotted path: a number, a text, or a time in nanoseconds; None where it cannot.

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

    So is one after January 2038, which ROS 2 has no stamp for.
    """
    if len(payload) < _ROS1_STAMP.size:
        return None
    seconds, nanoseconds = _ROS1_STAMP.unpack_from(payload)
    if nanoseconds >= _NS_PER_SECOND:
        return None
    stamp = int(seconds * _NS_PER_SECOND + nanoseconds)
    return stamp if stamp <= LATEST_STAMP else None
