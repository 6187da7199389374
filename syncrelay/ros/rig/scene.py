"""What the simulated sensors see, serialized once: colours that slide, a beam that sweeps a room, an IMU that turns."""

import math
import sys
from array import array
from collections.abc import Callable, Mapping
from types import MappingProxyType

from rclpy.serialization import serialize_message
from sensor_msgs.msg import Image, Imu, PointCloud2, PointField
from std_msgs.msg import Header

WIDTH, HEIGHT = 640, 480
RINGS, POINTS_PER_RING = 16, 1250

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
    message = Image(header=Header(frame_id="camera"), height=HEIGHT, width=WIDTH, encoding="rgb8", step=step)
    message.data = array("B", pixels)
    return bytes(serialize_message(message))


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
    message = PointCloud2(header=Header(frame_id="lidar"), height=RINGS, width=POINTS_PER_RING, is_dense=True)
    message.fields = [
        PointField(name=name, offset=4 * place, datatype=PointField.FLOAT32, count=1)
        for place, name in enumerate(("x", "y", "z", "intensity"))
    ]
    message.point_step, message.row_step = 16, 16 * POINTS_PER_RING
    message.is_bigendian = sys.byteorder == "big"
    message.data = array("B", points.tobytes())
    return bytes(serialize_message(message))


def imu_samples() -> tuple[bytes, ...]:
    """Serialized `sensor_msgs/msg/Imu`s with stamp 0: level, turning about z once in two seconds."""
    return tuple(_imu_sample(math.tau * sample / _IMU_SAMPLES) for sample in range(_IMU_SAMPLES))


def _imu_sample(yaw: float) -> bytes:
    message = Imu(header=Header(frame_id="imu"))
    message.orientation.z, message.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    message.angular_velocity.z = math.tau / 2
    message.linear_acceleration.z = 9.81
    return bytes(serialize_message(message))


SCENES: Mapping[str, tuple[type, Callable[[], tuple[bytes, ...]]]] = MappingProxyType(
    {"camera": (Image, images), "lidar": (PointCloud2, clouds), "imu": (Imu, imu_samples)}
)
