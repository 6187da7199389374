"""What the sensors of a scenario send: one row for each stream."""

import math
import random
from dataclasses import dataclass
from typing import TypedDict

from tests.ros.cdr_messages import VECTOR

POINT = "geometry_msgs/msg/PointStamped"
"""Another type with the same fields as VECTOR: its messages are the same bytes."""


class OnItsGrid(TypedDict, total=False):
    """Where the samples of a `Stream` are, as its keywords."""

    phase_ms: float
    wobble_ms: float


@dataclass(frozen=True, slots=True)
class Stream:
    """A sensor's messages in some acts of a play. Without an act in which it is named, its publisher is gone.

    Samples are taken on one grid for all streams: at multiples of the period, `phase_ms` later. Stamps tell the time
    of the sample by the stream's `clock` (`wall`, `boot`, `zero`, or `none` for messages that are cut short), which is
    `shift_ms` off and runs `ppm` too fast.
    A message is sent `late_ms` after its sample, give or take `jitter_ms`; with `batch_ms`, all of such a time at once.
    A rate of 0 is a publisher that sends nothing.
    """

    topic: str
    hz: float
    acts: str = "123"
    node: str = ""
    phase_ms: float = 0
    wobble_ms: float = 0
    """How far a sample may be from its place on the grid."""
    clock: str = "wall"
    shift_ms: float = 0
    ppm: float = 0
    repeat: int = 1
    """How many messages share a stamp."""
    late_ms: float = 2
    jitter_ms: float = 1
    batch_ms: float = 0
    type: str = VECTOR
    reliability: str = "reliable"
    durability: str = "volatile"

    @property
    def driver(self) -> str:
        """The name of the node that sends it."""
        return self.node or f"{self.topic.rpartition('/')[2]}_driver"

    @property
    def publisher(self) -> tuple[str, ...]:
        """What two streams of one publisher have in common."""
        return self.driver, self.topic, self.type, self.reliability, self.durability


class Sampler:
    """The samples of one stream, one after another; times are seconds after the play began."""

    def __init__(self, stream: Stream, *, now: float = 0.0, seed: int = 0) -> None:
        self.stream = stream
        self._chance = random.Random(f"{seed} {stream.topic}")
        self._number = max(0, math.ceil(now * stream.hz))
        self._sent = now
        self._stamp = 0.0

    def next(self) -> tuple[float, float, float]:
        """When to send the next message, when its sample was taken, and its stamp in seconds of the play."""
        stream, chance = self.stream, self._chance
        sampled = self._number / stream.hz + stream.phase_ms / 1000
        sampled += chance.uniform(-stream.wobble_ms, stream.wobble_ms) / 1000
        sent = sampled + (stream.late_ms + chance.uniform(-stream.jitter_ms, stream.jitter_ms)) / 1000
        if stream.batch_ms:
            sent = math.ceil(sent * 1000 / stream.batch_ms) * stream.batch_ms / 1000
        if self._number % stream.repeat == 0:
            self._stamp = sampled + sampled * stream.ppm / 1e6 + stream.shift_ms / 1000
        self._number += 1
        self._sent = max(sent, self._sent)
        return self._sent, sampled, self._stamp
