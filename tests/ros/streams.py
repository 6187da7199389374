"""Made-up recordings: small, seeded, told apart by their stamps."""

import random
from collections.abc import Iterable

from tests.ros.cdr_messages import NS_PER_SECOND, VECTOR, vector
from tests.ros.frames import Frame

MS = 1_000_000
BEGIN = 1_700_000_000 * NS_PER_SECOND


def at(topic: str, *offsets_ms: float) -> list[Frame]:
    """Vectors of one topic with these stamps, in milliseconds after BEGIN."""
    stamps = [BEGIN + round(offset * MS) for offset in offsets_ms]
    return [Frame(topic, VECTOR, stamp, vector(stamp)) for stamp in stamps]


def jittery(topic: str, *, period_ms: float, jitter_ms: float, count: int, seed: int) -> list[Frame]:
    """Vectors of one topic at a rate, each up to `jitter_ms` early or late."""
    chance = random.Random(seed)
    return at(topic, *(n * period_ms + chance.uniform(-jitter_ms, jitter_ms) for n in range(1, count + 1)))


def merged(*topics: Iterable[Frame]) -> list[Frame]:
    """All messages in the order of their receive times."""
    return sorted((frame for frames in topics for frame in frames), key=lambda frame: frame.time)
