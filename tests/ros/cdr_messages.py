"""Messages of the tests as CDR bytes, made and read without the relay's own code."""

import struct
from typing import Any, Literal

from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)

VECTOR = "geometry_msgs/msg/Vector3Stamped"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
TIME_REFERENCE = "sensor_msgs/msg/TimeReference"
CLOCK = "rosgraph_msgs/msg/Clock"
STRING = "std_msgs/msg/String"

NS_PER_SECOND = 1_000_000_000


def serialize(type_name: str, *fields: Any, little_endian: bool = True) -> bytes:
    """A message of a type with its fields in their order."""
    message = STORE.types[type_name](*fields)
    return bytes(STORE.serialize_cdr(message, type_name, little_endian=little_endian))


def time(stamp: int) -> Any:
    return STORE.types["builtin_interfaces/msg/Time"](*divmod(stamp, NS_PER_SECOND))


def header(stamp: int, frame_id: str = "base") -> Any:
    return STORE.types["std_msgs/msg/Header"](time(stamp), frame_id)


def vector(stamp: int, *, frame_id: str = "base", little_endian: bool = True) -> bytes:
    """A Vector3Stamped whose numbers tell its stamp, so that no two are equal.

    Packed by hand, as tests make many thousands of them: encapsulation, seconds, nanoseconds, the text's length with
    its closing zero, the text, padding to eight bytes behind the encapsulation, x, y, z.
    """
    order = "<" if little_endian else ">"
    text = frame_id.encode() + b"\0"
    head = struct.pack(f"{order}iII", *divmod(stamp, NS_PER_SECOND), len(text)) + text
    xyz = struct.pack(f"{order}3d", stamp / 3, stamp % 1000, -1.5)
    return bytes((0, little_endian, 0, 0)) + head + bytes(-len(head) % 8) + xyz


def stamp_of(payload: bytes) -> int:
    """Nanoseconds of the leading Header's stamp."""
    order: Literal["little", "big"] = "little" if payload[1] else "big"
    seconds = int.from_bytes(payload[4:8], order, signed=True)
    return seconds * NS_PER_SECOND + int.from_bytes(payload[8:12], order)


def with_stamp(payload: bytes, stamp: int) -> bytes:
    """The payload with other bytes in the place of its leading Header's stamp."""
    order: Literal["little", "big"] = "little" if payload[1] else "big"
    seconds, nanoseconds = divmod(stamp, NS_PER_SECOND)
    return payload[:4] + seconds.to_bytes(4, order, signed=True) + nanoseconds.to_bytes(4, order) + payload[12:]


def padded(payload: bytes) -> bytes:
    """The payload up to a multiple of four bytes.

    Whatever RTPS does not carry in fragments it pads so (DDSI-RTPS 2.5, 9.4.1), and Fast DDS hands the padding
    to a raw subscription as a part of the payload.
    """
    return payload + bytes(-len(payload) % 4)


def stamps_of(payloads: list[bytes]) -> list[int]:
    return [stamp_of(payload) for payload in payloads]
