"""`syncrelay demo --record FILE`: the demo's rig as a recording, made at once and without ROS."""

import heapq
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import Final

from syncrelay.cdr import patch_stamp
from syncrelay.cli.boundary import DONE, put
from syncrelay.printable import printable
from syncrelay.recordings.bag.definitions import jazzy_definition
from syncrelay.recordings.bag.mcap_output import McapOutput
from syncrelay.recordings.bag.qos import Profile
from syncrelay.rig.scene import SCENES
from syncrelay.rig.schedule import SENSORS, schedule

_SECOND: Final = 1_000_000_000
# Any time would do; always the same makes the same recording.
_START: Final = 1_767_225_600 * _SECOND
# What a message takes from its publisher to the recorder.
_ON_THE_WAY: Final = 500_000
_DEFAULT_S: Final = 30.0


def record(output: str, seconds: float | None, seed: int) -> int:
    """Write what the rig sends in a time, 30 s by default; the same seed gives the same recording. Returns 0."""
    end = _START + round((seconds or _DEFAULT_S) * _SECOND)
    counts = dict.fromkeys(SENSORS, 0)
    with McapOutput(Path(output)) as recording:
        outputs = {}
        for name, sensor in SENSORS.items():
            profile = Profile(depth=5, reliability="reliable" if sensor.reliable else "best_effort")
            type_name = SCENES[name][0]
            outputs[name] = recording.add(sensor.topic, type_name, *jazzy_definition(type_name), profile)
        for received, name, payload in heapq.merge(*(_sent(name, seed, end) for name in SENSORS)):
            recording.write(outputs[name], payload, received)
            counts[name] += 1
    put(f"{printable(output)}: {', '.join(f'{count} of {SENSORS[name].topic}' for name, count in counts.items())}")
    return DONE


def _sent(name: str, seed: int, end: int) -> Iterator[tuple[int, str, bytes]]:
    frames = SCENES[name][1]()
    for shot in takewhile(lambda shot: shot.sent < end, schedule(SENSORS[name], seed=seed, start=_START)):
        yield shot.sent + _ON_THE_WAY, name, patch_stamp(frames[shot.number % len(frames)], shot.stamp)
