"""Analyses of simulated recordings, and what a page packs, unpacked by a plain reader."""

import gzip
import json
import random
import re
from base64 import b64decode
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from syncrelay.recordings.analysis import Analysis, analyze
from tests.recordings.bag.making import write_mcap
from tests.recordings.bag.reading import bound
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS, jittery, merged

TOPICS = ("/camera", "/lidar", "/imu")
HOSTILE = "</script><script>window.stranger=1</script><img src=x onerror='window.stranger=1'>\"'`<b>`&amp;"


def drive(*, seconds: int, slow_down: int = 1) -> list[Frame]:
    """A camera at 10 Hz, a lidar at 10 Hz and an IMU at 50 Hz, or so many times slower."""
    periods = [100 * slow_down, 100 * slow_down, 20 * slow_down]
    streams = [
        jittery(topic, period_ms=period, jitter_ms=3, count=1000 * seconds // period, seed=seed)
        for seed, (topic, period) in enumerate(zip(TOPICS, periods, strict=True))
    ]
    return merged(*streams)


def analyzed(folder: Path, frames: Sequence[Frame], **keys: Any) -> Analysis:
    """What the analysis makes of a group of TOPICS; a key that is None is left out."""
    defaults = {"policy": "approximate_time", "slop": "4ms", "topics": inputs(dict.fromkeys(TOPICS, VECTOR))}
    group = {key: value for key, value in {**defaults, **keys}.items() if value is not None}
    text = config({"fused": group})
    with bound(write_mcap(folder / "drive.mcap", frames), text=text) as (recording, bindings):
        return analyze(recording, text, bindings)


def of_device(folder: Path, *, seconds: int) -> Analysis:
    """The analysis of a drive whose lidar has a clock of its own: 200 ppm slow, and set back by 3 s halfway.

    Each of its messages is received up to 4 ms later than the quickest, which takes 6 ms; of those, 5 are taken off.
    """
    chance = random.Random(1)
    frames = [frame for frame in drive(seconds=seconds) if frame.topic == "/camera"]
    for number in range(10 * seconds):
        ms = 100 * number
        by_device = ms * (1 - 200e-6) - (3000 if 2 * number >= 10 * seconds else 0)
        received = BEGIN + round((ms + 6 + 4 * chance.random()) * MS)
        frames.append(Frame("/lidar", VECTOR, received, vector(BEGIN + round(by_device * MS))))
    topics = inputs(dict.fromkeys(("/camera", "/lidar"), VECTOR))
    topics[1] |= {"clock": "device", "delay": "5ms"}
    return analyzed(folder, merged(frames), slop="20ms", topics=topics)


def renamed(analysis: Analysis) -> Analysis:
    """The same with HOSTILE wherever a name stands that a recording or its owner could have chosen."""
    (group,) = analysis.groups
    topics = tuple(replace(topic, topic=HOSTILE, type=HOSTILE) for topic in group.group.topics)
    hostile = replace(
        group,
        group=replace(group.group, name=HOSTILE, topics=topics),
        streams=tuple(replace(stream, topic=HOSTILE, type=HOSTILE) for stream in group.streams),
        pairs=tuple(replace(pair, first=HOSTILE, second=HOSTILE) for pair in group.pairs),
        suggestion=replace(group.suggestion, changes=(), hints=(HOSTILE,)),
    )
    named = tuple(replace(topic, topic=HOSTILE, type=HOSTILE) for topic in analysis.topics)
    return replace(analysis, topics=named, groups=(hostile,))


def drawings_in(page: str) -> dict[str, Any]:
    """What a page hands to its script."""
    found = re.search(r'<script type="application/json" id="drawings">(.*?)</script>', page, re.DOTALL)
    assert found
    return json.loads(found[1])


def unpacked(packed: dict[str, Any]) -> list[int]:
    """The numbers that were packed, in units."""
    planes, count = gzip.decompress(b64decode(packed["steps"])), packed["count"]
    values, value = [], 0
    for at in range(count):
        value += int.from_bytes(planes[at::count][:4], "little", signed=True)
        values.append(value * packed["unit"])
    return values
