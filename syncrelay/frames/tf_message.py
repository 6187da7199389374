"""Frames in serialized messages: the frame_id of a leading Header, and the transforms of a tf2_msgs/msg/TFMessage.

The layout is that of `syncrelay.cdr`. Behind the stamp of a Header stands a string, its frame_id. A TFMessage is a
sequence of geometry_msgs/TransformStamped: a Header, the string child_frame_id, and seven doubles, which are aligned
to 8 bytes in plain CDR and to 4 in plain XCDR2, counted from the end of the encapsulation header.
"""

from math import isnan
from struct import Struct, error
from typing import Final

from syncrelay.cdr import Payload
from syncrelay.frames.buffer import Edge

TF_TYPE: Final = "tf2_msgs/msg/TFMessage"

# Byte orders and the alignment of a double, by the second byte of the encapsulation header.
_ENCAPSULATIONS: Final = {0x00: (">", 8), 0x01: ("<", 8), 0x06: (">", 4), 0x07: ("<", 4)}
_BODY_AT: Final = 4
_FRAME_AT: Final = 12
_LAYOUTS: Final = {order: tuple(Struct(order + code) for code in ("I", "iI", "7d")) for order in "<>"}
# The Header of ROS 1 has a number before its stamp, and its strings no final zero.
_ROS1_LENGTH: Final = Struct("<12xI")
_SECOND: Final = 1_000_000_000
# tf2 refuses a rotation whose square is farther from 1.
_UNIT: Final = 10e-3


def read_frame(payload: Payload) -> str:
    """Return the frame_id of the leading Header, empty where it cannot be read."""
    try:
        order, _ = _ENCAPSULATIONS[payload[1]]
        frame, _ = _read_string(memoryview(payload), _FRAME_AT, _LAYOUTS[order][0])
    except (error, UnicodeDecodeError, KeyError, IndexError):
        return ""
    return frame


def read_ros1_frame(payload: Payload) -> str:
    """Return the frame_id of the Header that a ROS 1 payload begins with, empty where it cannot be read."""
    try:
        (length,) = _ROS1_LENGTH.unpack_from(payload)
        return bytes(payload[_ROS1_LENGTH.size : _ROS1_LENGTH.size + length]).decode()
    except (error, UnicodeDecodeError):
        return ""


def read_transforms(payload: Payload, *, is_static: bool) -> list[Edge]:
    """Return the transforms of a TFMessage that tf2 would take, up to where the payload is malformed.

    tf2 refuses those with a number that is none, and those whose rotation is no unit quaternion.
    """
    if len(payload) < _BODY_AT or payload[0] or payload[1] not in _ENCAPSULATIONS:
        return []
    order, alignment = _ENCAPSULATIONS[payload[1]]
    length, time, numbers = _LAYOUTS[order]
    body, edges = memoryview(payload)[_BODY_AT:], list[Edge]()
    try:
        (count,) = length.unpack_from(body)
        place = length.size
        for _ in range(count):
            seconds, nanoseconds = time.unpack_from(body, _aligned(place, 4))
            parent, place = _read_string(body, _aligned(place, 4) + time.size, length)
            child, place = _read_string(body, place, length)
            place = _aligned(place, alignment)
            transform = numbers.unpack_from(body, place)
            place += numbers.size
            if nanoseconds < _SECOND and _is_valid(transform):
                edges.append(Edge(parent, child, seconds * _SECOND + nanoseconds, is_static))
    except (error, UnicodeDecodeError):
        pass
    return edges


def _is_valid(transform: tuple[float, ...]) -> bool:
    norm = sum(each * each for each in transform[3:])
    return not any(map(isnan, transform)) and abs(norm - 1.0) < _UNIT


def _aligned(place: int, size: int) -> int:
    return (place + size - 1) // size * size


def _read_string(body: memoryview, place: int, length: Struct) -> tuple[str, int]:
    """Return a string and where it ends. Raises struct.error for one that the bytes cannot hold."""
    place = _aligned(place, 4)
    (count,) = length.unpack_from(body, place)
    end = place + length.size + count
    if end > len(body):
        raise error("a string that is longer than the message")
    return bytes(body[place + length.size : end]).rstrip(b"\0").decode(), end
