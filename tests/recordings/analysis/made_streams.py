"""Streams of which all is known, for the analysis."""

import random

from syncrelay.recordings.analysis.streams import Stream
from tests.ros.cdr_messages import VECTOR
from tests.ros.streams import BEGIN, MS


def streams_of(*topics, latency=5 * MS, late=0):
    """Streams of stamps in nanoseconds, received `latency` later, and those of the first topic later by `late`."""
    came = sorted(
        (stamp + latency + (0 if index else late), index, stamp)
        for index, stamps in enumerate(topics)
        for stamp in stamps
    )
    streams = [Stream(f"/{'abcdef'[index]}", VECTOR) for index in range(len(topics))]
    for place, (received, index, stamp) in enumerate(came):
        for values, value in (("stamps", stamp), ("received", received), ("places", place)):
            getattr(streams[index], values).append(value)
    return streams


def every(period, count, *, phase=0, jitter=0, seed=1):
    chance = random.Random(seed)
    return [BEGIN + phase + n * period + round(chance.uniform(-jitter, jitter)) for n in range(count)]
