"""A group of any two of three inputs over DDS: one of the publishers is killed and returns."""

import json
import signal
import time

import pytest

from tests.faults.flow import without_shared_memory
from tests.ros.cdr_messages import VECTOR, stamp_of, vector
from tests.ros.configs import config
from tests.ros.frames import Frame
from tests.ros.stage import Player, Stage, both_backends
from tests.ros.status import ANY_PORT, status
from tests.ros.streams import MS

pytestmark = pytest.mark.ros

_NAMES = ("/top", "/left", "/right")
_PERIOD = 100 * MS
_TURNS = 1_000


def _lidar(stage: Stage, name: str, begin: int) -> Player:
    """A lidar of 10 Hz whose turns are those of all others, from now on; its stamps are its own."""
    place = _NAMES.index(name)
    player = stage.player({name: VECTOR}, node=name.strip("/"))
    player.match()
    first = (time.time_ns() - begin) // _PERIOD + 5
    stamps = [begin + turn * _PERIOD + place * MS for turn in range(first, _TURNS)]
    player.start_by_clock([Frame(name, VECTOR, stamp, vector(stamp)) for stamp in stamps])
    return player


@both_backends
def test_sets_leave_while_one_of_three_is_dead_and_are_whole_when_it_is_back(stage: Stage):
    group = {
        "policy": "approximate_time",
        "slop": "20ms",
        "quorum": 2,
        "max_wait": "60ms",
        "restamp": "earliest",
        "topics": [{"topic": name, "type": VECTOR, "min_period": "70ms"} for name in _NAMES],
    }
    # Who is killed while it holds shared memory may leave that so that others hear no more.
    without_shared_memory(stage)
    relay = stage.relay(config({"all": group}, metrics=ANY_PORT))
    collector = stage.collector({f"/all{name}": VECTOR for name in _NAMES})
    begin = time.time_ns()
    lidars = {name: _lidar(stage, name, begin) for name in _NAMES}
    stamps: dict[str, list[int]] = {}

    def leave_together(names: tuple[str, ...], since: int) -> bool:
        """Whether ten sets in a row have left of these alone."""
        nonlocal stamps
        stamps = {name: [stamp_of(each) for each in collector.payloads(f"/all{name}")] for name in _NAMES}
        common = sorted(set.intersection(*(set(stamps[name]) for name in names)))
        alone = [
            each
            for each in common
            if each > since and not any(each in stamps[other] for other in _NAMES if other not in names)
        ]
        return len(alone) >= 10

    def last() -> int:
        return max(stamp for each in stamps.values() for stamp in each)

    collector.process.wait_until(lambda: leave_together(_NAMES, 0), "sets of three")
    for dead in ("/top", "/right"):
        lidars[dead].process.send(signal.SIGKILL)
        lidars[dead].process.wait()
        killed, others = last(), tuple(name for name in _NAMES if name != dead)
        collector.process.wait_until(lambda names=others, at=killed: leave_together(names, at), f"sets without {dead}")
        lidars[dead] = _lidar(stage, dead, begin)
        back = last()
        collector.process.wait_until(lambda at=back: leave_together(_NAMES, at), f"sets with {dead} again")
    shown = status(relay)
    (inputs,) = [group["inputs"] for group in shown["groups"]]
    for each in inputs:
        assert each["received"] == each["matched"] + sum(each["dropped"].values()) + each["buffered"], json.dumps(each)
    # Each set has one stamp, on each output no stamp twice, and they rise.
    assert all(each == sorted(set(each)) for each in stamps.values())
