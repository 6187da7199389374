"""When each message of a simulated sensor is stamped and sent: the same seed and start give the same times."""

import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType
from typing import NamedTuple

_SECOND = 1_000_000_000
_MS = 1_000_000


@dataclass(frozen=True, slots=True)
class Sensor:
    """What a sensor does and how badly; all times in nanoseconds.

    It measures at `phase` after each period's begin. Its stamps are `clock_error` off and scatter by `jitter`
    (standard deviation). A message is sent `latency` later, give or take `latency_jitter`. `loss` is the share
    of messages that it never sends. `reliable` is its QoS.
    """

    topic: str
    rate_hz: int | Fraction
    phase: int
    clock_error: int
    jitter: int
    latency: int
    latency_jitter: int
    loss: float
    reliable: bool


# The camera is triggered by the lidar, every third frame with a sweep, as on a rig that is wired for fusion: what
# keeps the two apart is the camera's clock alone. The IMU runs free.
#
# Real drivers offer best effort. The IMU does too, but not what is large: through Fast DDS's default segment of
# shared memory (512 kB) best effort brought 33 of 170 images of 921 kB, reliable 170 of 170.
SENSORS: Mapping[str, Sensor] = MappingProxyType(
    {
        "camera": Sensor(
            topic="/demo/camera/image_raw",
            rate_hz=30,
            phase=0,
            clock_error=12 * _MS,
            jitter=_MS // 2,
            latency=20 * _MS,
            latency_jitter=4 * _MS,
            loss=0.03,
            reliable=True,
        ),
        "lidar": Sensor(
            topic="/demo/lidar/points",
            rate_hz=10,
            phase=0,
            clock_error=0,
            jitter=_MS,
            latency=30 * _MS,
            latency_jitter=6 * _MS,
            loss=0.02,
            reliable=True,
        ),
        "imu": Sensor(
            topic="/demo/imu/data",
            rate_hz=100,
            phase=3 * _MS,
            clock_error=0,
            jitter=_MS // 4,
            latency=2 * _MS,
            latency_jitter=_MS,
            loss=0.01,
            reliable=False,
        ),
    }
)


class Shot(NamedTuple):
    """One message: its number from 0, its stamp, and when it is sent, in nanoseconds of the system's clock."""

    number: int
    stamp: int
    sent: int


def schedule(sensor: Sensor, *, seed: int, start: int) -> Iterator[Shot]:
    """Give the messages that the sensor sends, for ever; lost ones leave a gap in the numbers.

    Messages are sent in the order of their stamps, as by a driver that reads one queue.
    """
    chance = random.Random(f"{seed} {sensor.topic}")  # noqa: S311 - repeatable is the point
    sent = number = 0
    while True:
        measured = start + sensor.phase + number * _SECOND // sensor.rate_hz
        stamp = measured + sensor.clock_error + round(chance.gauss(0, sensor.jitter))
        sent = max(sent, measured + sensor.latency + round(chance.gauss(0, sensor.latency_jitter)))
        if chance.random() >= sensor.loss:
            yield Shot(number, stamp, sent)
        number += 1
