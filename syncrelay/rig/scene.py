"""What the simulated sensors see, serialized once: colours that slide, a beam that sweeps a room, an IMU that turns.

No ROS is needed, so that the rig can be recorded where none is installed: three types are serialized by hand.
"""

import math
import struct
import sys
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Self

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
    turns = np.arange(3 * WIDTH)[:, None] / WIDTH + np.arange(3) / 3
    row = np.rint(127.5 + 127.5 * np.cos(math.tau * turns)).astype(np.uint8)
    return tuple(_image(row, shift=WIDTH * frame // _IMAGES) for frame in range(_IMAGES))


def _image(row: "NDArray[np.uint8]", *, shift: int) -> bytes:
    pixels = b"".join(row[shift + y : shift + y + WIDTH].tobytes() for y in range(HEIGHT))
    message = _Message("camera").numbers("I", HEIGHT, WIDTH).text("rgb8")
    return message.numbers("B", 0).numbers("I", 3 * WIDTH).sequence(pixels).content()


def clouds() -> tuple[bytes, ...]:
    """Serialized `sensor_msgs/msg/PointCloud2`s with stamp 0: 20,000 points of a square room, a bright beam turning."""
    azimuths = math.tau * np.arange(POINTS_PER_RING) / POINTS_PER_RING
    x, y = np.cos(azimuths), np.sin(azimuths)
    # On the walls of a room 12 m square, ring by ring.
    distance = 6 / np.maximum(abs(x), abs(y))
    points = np.empty((RINGS, POINTS_PER_RING, len(_FIELDS)), np.float32)
    points[..., 0], points[..., 1] = x * distance, y * distance
    points[..., 2] = np.tan(np.radians(2 * np.arange(RINGS) - 15))[:, None] * distance
    messages = []
    for frame in range(_CLOUDS):
        points[..., 3] = 255 * (0.5 + 0.5 * np.cos(azimuths - math.tau * frame / _CLOUDS)) ** 8
        messages.append(_cloud(points.tobytes()))
    return tuple(messages)


def _cloud(points: bytes) -> bytes:
    message = _Message("lidar").numbers("I", RINGS, POINTS_PER_RING, len(_FIELDS))
    for place, name in enumerate(_FIELDS):
        message.text(name).numbers("I", 4 * place).numbers("B", _FLOAT32).numbers("I", 1)
    message.numbers("B", sys.byteorder == "big").numbers("I", 16, 16 * POINTS_PER_RING).sequence(points)
    is_dense = True
    return message.numbers("B", is_dense).content()


def imu_samples() -> tuple[bytes, ...]:
    """Serialized `sensor_msgs/msg/Imu`s with stamp 0: level, turning about z once in two seconds."""
    return tuple(_imu_sample(math.tau * sample / _IMU_SAMPLES) for sample in range(_IMU_SAMPLES))


def _imu_sample(yaw: float) -> bytes:
    orientation = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    turning, gravity, covariance = (0.0, 0.0, math.tau / 2), (0.0, 0.0, 9.81), (0.0,) * 9
    numbers = (*orientation, *covariance, *turning, *covariance, *gravity, *covariance)
    return _Message("imu").numbers("d", *numbers).content()


class _Message:
    """A message with a std_msgs/msg/Header of stamp 0, serialized as CDR field by field."""

    def __init__(self, frame_id: str) -> None:
        # Alignment counts from behind the encapsulation header, which says which end of a number comes first.
        self._head = bytes([0, sys.byteorder == "little", 0, 0])
        self._body = bytearray()
        self.numbers("i", 0).numbers("I", 0).text(frame_id)

    def numbers(self, kind: str, *values: float) -> Self:
        """Add numbers of one of struct's kinds, aligned to their size."""
        self._body += bytes(-len(self._body) % struct.calcsize(kind))
        self._body += struct.pack(f"={len(values)}{kind}", *values)
        return self

    def text(self, text: str) -> Self:
        return self.sequence(text.encode() + b"\0")

    def sequence(self, content: bytes) -> Self:
        """Add bytes behind their number."""
        self.numbers("I", len(content))
        self._body += content
        return self

    def content(self) -> bytes:
        return self._head + self._body


SCENES: Mapping[str, tuple[str, Callable[[], tuple[bytes, ...]]]] = MappingProxyType(
    {"camera": (IMAGE, images), "lidar": (POINT_CLOUD, clouds), "imu": (IMU, imu_samples)}
)
"""The type of each sensor's messages, and what makes them."""
