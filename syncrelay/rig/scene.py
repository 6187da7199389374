"""What the simulated sensors see, serialized once: colours that slide, a beam that sweeps a room, an IMU that turns.

No ROS is needed: rosbags serializes, so that the rig can be recorded where none is installed.
"""

import math
import sys
from array import array
from collections.abc import Callable, Mapping
from functools import cache
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

IMAGE: Final = "sensor_msgs/msg/Image"
POINT_CLOUD: Final = "sensor_msgs/msg/PointCloud2"
IMU: Final = "sensor_msgs/msg/Imu"

WIDTH, HEIGHT = 640, 480
RINGS, POINTS_PER_RING = 16, 1250

_FIELDS: Final = ("x", "y", "z", "intensity")
# sensor_msgs/msg/PointField.FLOAT32
_FLOAT32: Final = 7

# The scene turns once in two seconds for lidar and IMU; of the big images fewer are kept, and they slide faster.
_IMAGES = 15
_CLOUDS = 20
_IMU_SAMPLES = 200


def images() -> tuple[bytes, ...]:
    """Serialized 640x480 rgb8 `sensor_msgs/msg/Image`s with stamp 0: diagonal colours that slide to the left."""
    row = b"".join(_rainbow(x / WIDTH) for x in range(WIDTH)) * 3
    return tuple(_image(row, shift=WIDTH * frame // _IMAGES) for frame in range(_IMAGES))


def _rainbow(turn: float) -> bytes:
    return bytes(round(127.5 + 127.5 * math.cos(math.tau * (turn + third / 3))) for third in range(3))


def _image(row: bytes, *, shift: int) -> bytes:
    step = 3 * WIDTH
    pixels = b"".join(row[3 * (shift + y) : 3 * (shift + y) + step] for y in range(HEIGHT))
    return _serialized(IMAGE, _header("camera"), HEIGHT, WIDTH, "rgb8", 0, step, np.frombuffer(pixels, np.uint8))


def clouds() -> tuple[bytes, ...]:
    """Serialized `sensor_msgs/msg/PointCloud2`s with stamp 0: 20,000 points of a square room, a bright beam turning."""
    room = _room()
    return tuple(_cloud(room, beam=math.tau * frame / _CLOUDS) for frame in range(_CLOUDS))


def _azimuths() -> list[float]:
    return [math.tau * step / POINTS_PER_RING for step in range(POINTS_PER_RING)]


def _room() -> "array[float]":
    """Return x, y, z and a place for the intensity of points on the walls of a room 12 m square, ring by ring."""
    points = array("f")
    for ring in range(RINGS):
        rise = math.tan(math.radians(2 * ring - 15))
        for azimuth in _azimuths():
            x, y = math.cos(azimuth), math.sin(azimuth)
            distance = 6 / max(abs(x), abs(y))
            points.extend((x * distance, y * distance, rise * distance, 0))
    return points


def _cloud(room: "array[float]", *, beam: float) -> bytes:
    points = room[:]
    points[3::4] = array("f", [255 * (0.5 + 0.5 * math.cos(azimuth - beam)) ** 8 for azimuth in _azimuths()] * RINGS)
    fields = [_message("PointField", name, 4 * place, _FLOAT32, 1) for place, name in enumerate(_FIELDS)]
    content = np.frombuffer(points.tobytes(), np.uint8)
    is_bigendian = sys.byteorder == "big"
    shape = (RINGS, POINTS_PER_RING, fields, is_bigendian, 16, 16 * POINTS_PER_RING, content, True)
    return _serialized(POINT_CLOUD, _header("lidar"), *shape)


def imu_samples() -> tuple[bytes, ...]:
    """Serialized `sensor_msgs/msg/Imu`s with stamp 0: level, turning about z once in two seconds."""
    return tuple(_imu_sample(math.tau * sample / _IMU_SAMPLES) for sample in range(_IMU_SAMPLES))


def _imu_sample(yaw: float) -> bytes:
    orientation = _message("Quaternion", 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2), package="geometry_msgs")
    turning = _message("Vector3", 0.0, 0.0, math.tau / 2, package="geometry_msgs")
    gravity = _message("Vector3", 0.0, 0.0, 9.81, package="geometry_msgs")
    unknown = np.zeros(9)
    return _serialized(IMU, _header("imu"), orientation, unknown, turning, unknown, gravity, unknown)


@cache
def _types() -> Typestore:
    return get_typestore(Stores.ROS2_JAZZY)


def _message(name: str, *fields: Any, package: str = "sensor_msgs") -> Any:
    return _types().types[f"{package}/msg/{name}"](*fields)


def _header(frame_id: str) -> Any:
    return _message("Header", _message("Time", 0, 0, package="builtin_interfaces"), frame_id, package="std_msgs")


def _serialized(type_name: str, *fields: Any) -> bytes:
    return bytes(_types().serialize_cdr(_types().types[type_name](*fields), type_name))


SCENES: Mapping[str, tuple[str, Callable[[], tuple[bytes, ...]]]] = MappingProxyType(
    {"camera": (IMAGE, images), "lidar": (POINT_CLOUD, clouds), "imu": (IMU, imu_samples)}
)
"""The type of each sensor's messages, and what makes them."""
