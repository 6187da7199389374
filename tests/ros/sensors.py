"""A rig of camera and lidar that play at their pace, a relay of them, and what its log says."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import Process
from tests.ros.stage import Player, Stage
from tests.ros.status import ANY_PORT, status
from tests.ros.streams import BEGIN, MS, at

PAIR = {"/camera": VECTOR, "/lidar": VECTOR}

APPROXIMATE = {"policy": "approximate_time", "slop": "20ms"}

# As long as a test may last: what plays on and on ends with its test, however slow the machine.
ON_AND_ON_MS = 300_000

# Findings that are true of a rig on a busy machine, which no test can prevent.
OF_A_BUSY_MACHINE = {"too_slow", "bursts", "slowed", "silent"}


def front(topics: Sequence[Mapping[str, Any]] | None = None, top: Mapping[str, Any] | None = None, **keys: Any) -> str:
    """One group of camera and lidar, whose relay says its state on a port of its own."""
    group = {**APPROXIMATE, **keys, "topics": topics or inputs(PAIR)}
    return config({"front": group}, **{"metrics": ANY_PORT, **(top or {})})


def stream(
    topic: str, *, hz: float, late_ms: float = 0, shift_ms: float = 0, last_ms: float = ON_AND_ON_MS
) -> list[Frame]:
    """Messages of one topic, stamped `shift_ms` off their time and sent `late_ms` after it."""
    sent = [n * 1000 / hz for n in range(round(last_ms * hz / 1000))]
    shifted = at(topic, *(offset + shift_ms for offset in sent))
    return [
        frame._replace(time=BEGIN + round((offset + late_ms) * MS)) for frame, offset in zip(shifted, sent, strict=True)
    ]


def play(stage: Stage, frames: Sequence[Frame], *, node: str = "driver", **qos: str) -> Player:
    """A node that sends these frames at their pace from when the relay listens on."""
    player = stage.player({frame.topic: frame.type_name for frame in frames}, node=node, **qos)
    player.match()
    player.start(frames, speed=1)
    return player


def wait_for_sets(relay: Process, more: int, group: str = "front") -> None:
    """Wait until so many more sets have left a group than now."""

    def sets() -> int:
        return next((int(each["sets"]) for each in status(relay)["groups"] if each["name"] == group), 0)

    before = sets()
    relay.wait_until(lambda: sets() >= before + more, f"{more} sets of {group}")


def assert_logged(relay: Process, pattern: str) -> None:
    """A line of the log holds the pattern, sooner or later."""
    relay.wait_until(lambda: re.search(pattern, relay.stderr) is not None, f"{pattern!r} in the log")
