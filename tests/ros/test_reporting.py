"""Where findings are seen: /diagnostics, topics for plotting, `observe`, HTTP."""

import struct
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.processes import wait_until
from tests.ros.sensors import PAIR, front, play, stream
from tests.ros.stage import Collector, Stage
from tests.ros.streams import merged
from tests.test_foxglove import detailed, plotted

pytestmark = pytest.mark.ros

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
LOG = "rcl_interfaces/msg/Log"
FLOAT = "std_msgs/msg/Float64"
_STORE = get_typestore(Stores.ROS2_JAZZY)
_RIG = merged(stream("/camera", hz=10), stream("/lidar", hz=10, shift_ms=7))


def statuses(collector: Collector) -> dict[str, tuple[int, str, dict[str, str]]]:
    """The newest status of each name: its level, message and values."""
    newest = collector.payloads("/diagnostics")[-1:]
    arrays: list[Any] = [_STORE.deserialize_cdr(payload, DIAGNOSTICS) for payload in newest]
    return {
        each.name: (each.level, each.message, {pair.key: pair.value for pair in each.values})
        for array in arrays
        for each in array.status
    }


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


def test_diagnostics_have_a_status_for_each_group(stage: Stage):
    good = {"policy": "approximate_time", "slop": "20ms", "topics": inputs(PAIR)}
    text = config(
        {
            "front": good,
            "rear": {**good, "slop": "1ms"},
            "side": {**good, "topics": inputs({"/a": VECTOR, "/b": VECTOR})},
        }
    )
    stage.relay(text)
    collector = stage.collector({"/diagnostics": DIAGNOSTICS})
    play(stage, _RIG)
    seen: dict[str, tuple[int, str, dict[str, str]]] = {}

    def is_as_expected() -> bool:
        """Whether what they tell is undisturbed by what a busy machine holds up, and was tried."""
        nonlocal seen
        seen = statuses(collector)
        return (
            [level for level, _, _ in seen.values()] == [0, 2, 3]
            and float(seen["syncrelay: front"][2]["/camera rate (Hz)"]) > 5
            and seen["syncrelay: rear"][2].get("suggestion", "").startswith("write ")
            and seen["syncrelay: side"][1].startswith("nobody publishes /a ")
        )

    wait_until(
        is_as_expected,
        "OK of the group that works, ERROR of the one whose slop is too small, STALE of the one that gets nothing",
    )
    front_status, rear, _ = seen.values()
    assert list(seen) == ["syncrelay: front", "syncrelay: rear", "syncrelay: side"]
    assert front_status[1].endswith("at the 95th percentile")
    assert front_status[2]["span p95 (ms)"] == "7.00"
    assert rear[1] == "the nearest sets span 7 ms, over slop 1 ms"
    assert rear[2]["suggestion"].startswith("write `slop: 7ms`, which would give ")
    assert rear[2]["finding"] == "over_slop"


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
