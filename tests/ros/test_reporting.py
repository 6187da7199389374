"""Where findings are seen: /rosout, /diagnostics, topics for plotting, `observe`, HTTP."""

import struct
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from tests.ros.configs import config, inputs
from tests.ros.processes import wait_until
from tests.ros.sensors import PAIR, front, play, stream
from tests.ros.stage import Stage
from tests.ros.streams import merged
from tests.test_foxglove import detailed, plotted

pytestmark = pytest.mark.ros

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
LOG = "rcl_interfaces/msg/Log"
FLOAT = "std_msgs/msg/Float64"
_STORE = get_typestore(Stores.ROS2_JAZZY)
_RIG = merged(stream("/camera", hz=10), stream("/lidar", hz=10, shift_ms=7))


def test_rosout_says_where_a_line_was_logged(stage: Stage):
    collector = stage.collector({"/rosout": LOG})
    stage.relay(config({"front": {"policy": "exact_time", "topics": inputs(PAIR)}}))

    def lines() -> list[Any]:
        heard: list[Any] = [_STORE.deserialize_cdr(payload, LOG) for payload in collector.payloads("/rosout")]
        return [each for each in heard if each.msg.startswith("front: waiting for")]

    wait_until(lines, "the line that it waits for publishers, on /rosout")
    line = lines()[0]
    assert (line.name, line.level) == ("syncrelay", 20)
    text = Path(line.file).read_text().splitlines()[line.line - 1]
    assert "_LOG." in text, (line.file, line.line)


def test_what_the_foxglove_layout_draws_is_there_on_a_running_relay(stage: Stage):
    topics = dict.fromkeys(plotted(), FLOAT)
    assert set(topics) == {f"/syncrelay/front/{figure}" for figure in ("sets_hz", "span_ms", "latency_ms")}
    collector = stage.collector({**topics, "/diagnostics": DIAGNOSTICS})
    stage.relay(front(top={"diagnostics": {"scalars": True}}))
    play(stage, _RIG)

    def last_span() -> float:
        (span,) = struct.unpack("<d", collector.payloads("/syncrelay/front/span_ms")[-1][4:12])
        return float(span)

    collector.wait_for("/syncrelay/front/span_ms", 2)
    wait_until(lambda: last_span() == pytest.approx(7.0), "the span of all sets")
    assert all(collector.wait_for(topic, 2) for topic in topics)
    (told,) = collector.wait_for("/diagnostics", 1)[-1:]
    array: Any = _STORE.deserialize_cdr(told, DIAGNOSTICS)
    assert {detailed()} == {(each.hardware_id, each.name) for each in array.status}


def test_observe_exits_with_1_and_what_to_do(stage: Stage):
    look = stage.observe(front(), "--seconds", "6")
    assert look.wait() == 1
    told = " ".join(look.stdout.split())
    assert (
        f"ERROR: no other node was found on domain {stage.domain} (discovery range LOCALHOST) fix: start the robot's"
        " nodes; if they are running, compare ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE and RMW_IMPLEMENTATION on"
        " both sides, and run `syncrelay doctor --live`"
    ) in told
    assert "would have left: 0 sets hint: no values to suggest: no messages of /camera, /lidar" in told
    assert told.endswith("exit code 1: front has 1 error")
