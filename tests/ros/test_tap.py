"""`syncrelay tap` and a real relay over DDS: every set that leaves is a line."""

import json
import sys

import pytest

from tests.ros.cdr_messages import VECTOR, stamps_of
from tests.ros.configs import config, inputs
from tests.ros.relaying import conclude, connect
from tests.ros.sensors import stream
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT, address, first_group
from tests.ros.streams import merged

pytestmark = pytest.mark.ros

PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
OUT = {"/front/camera": VECTOR, "/front/lidar": VECTOR}
TEXT = config({"front": {"policy": "approximate_time", "slop": "20ms", "topics": inputs(PAIR)}}, metrics=ANY_PORT)


def test_every_set_that_leaves_is_a_line(stage: Stage):
    relay = stage.relay(TEXT)
    player, collector = stage.player(PAIR), stage.collector(OUT)
    recording = merged(
        *(stream(topic, hz=50, shift_ms=shift, last_ms=20_000) for topic, shift in (("/camera", 0), ("/lidar", 7)))
    )
    connect(player, collector, recording, OUT)
    first_group(relay)
    tap = stage.start("tap", [sys.executable, "-m", "syncrelay", "tap", "--json", "--url", address(relay)])

    def lines() -> list[dict]:
        return [json.loads(line) for line in tap.stdout.splitlines(keepends=True) if line.endswith("\n")]

    # It follows from its first line on: what leaves before is not its.
    def follows() -> bool:
        player.play(recording[:2])
        return bool(lines())

    tap.wait_until(follows, "the first line")
    player.play(recording)
    conclude(player, collector, recording, OUT)
    sets = stamps_of(collector.payloads("/front/camera"))
    told: list[int] = []

    def has_all() -> bool:
        told[:] = [line["stamps"]["/camera"] for line in lines() if "stamps" in line]
        return told[-1:] == sets[-1:]

    tap.wait_until(has_all, "the last set")
    # A collector that stood still has missed some: the tap has not.
    assert {stamp for stamp in sets if stamp >= told[0]} <= set(told)
    assert told == sorted(set(told))
    assert len(told) >= len(recording) // 2
    assert tap.stderr == ""
