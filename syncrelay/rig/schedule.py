"""When a simulated sensor stamps and sends its messages; the same seed and start give the same times."""

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
    """A sensor and its imperfections; times in nanoseconds.

    It measures `phase` after the begin of each period. Its stamps are off by `clock_error`, with a standard deviation
    of `jitter`. A message is sent `latency` later, with a standard deviation of `latency_jitter`. `loss` is the share
    of messages that are never sent. `reliable` is its QoS.
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


# The lidar triggers the camera, every third frame with a sweep, as on a rig that is wired for fusion: their stamps
# differ only because the camera's clock is off. The IMU runs free.
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
    """A message: its number from 0, its stamp, and when it is sent, in nanoseconds of the system clock."""

    number: int
    stamp: int
    sent: int


def schedule(sensor: Sensor, *, seed: int, start: int) -> Iterator[Shot]:
    """Yield the messages of a sensor without end; lost ones leave a gap in the numbers.

    They are sent in the order in which they are measured, as by a driver that reads one queue.
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
