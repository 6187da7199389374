"""Topics whose types the file leaves out: the graph has them, and what was taken stays."""

from typing import Any

import pytest

from tests.ros import relaying
from tests.ros.cdr_messages import IMAGE, STRING, VECTOR
from tests.ros.configs import LOSSLESS
from tests.ros.processes import Process, wait_until
from tests.ros.reloaded import ReloadedFile
from tests.ros.sensors import assert_logged
from tests.ros.stage import Stage
from tests.ros.status import findings, status, wait_for_finding
from tests.ros.streams import at, merged

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_FRONT = {f"/front{topic}": VECTOR for topic in _PAIR}
_REAR = {f"/rear{topic}": VECTOR for topic in _PAIR}

# A busy machine finds one node long after the other: a type that is to be contested must not be taken before.
_SETTLES_SLOWLY = "import syncrelay.relay.types as types\ntypes._SETTLE_S = 5.0\n"


def _exact(*topics: str, **keys: Any) -> dict[str, Any]:
    return {"policy": "exact_time", "topics": [{"topic": topic, "qos": LOSSLESS, **keys} for topic in topics]}


def _types(relay: Process, group: str) -> list[str | None]:
    groups = {each["name"]: each for each in status(relay)["groups"]}
    return [each["type"] for each in groups[group]["inputs"]] if group in groups else []


def test_a_type_is_its_publishers_and_stays_when_these_go(stage: Stage):
    recording = merged(at("/camera", 0, 10, 20), at("/lidar", 0, 10, 20))
    file = ReloadedFile(stage, front=_exact(*_PAIR))
    collector = stage.collector(_FRONT | _REAR)
    player = stage.player(_PAIR)
    relaying.connect(player, collector, recording, _FRONT)
    player.play(recording)
    relaying.conclude(player, collector, recording, _FRONT)
    expected = [(frame.payload, frame.payload) for frame in at("/camera", 0, 10, 20)]
    assert relaying.sets_within(recording, collector, _FRONT) == expected
    player.process.ask_to_end()
    player.process.wait()
    stage.player({"/camera": IMAGE}, node="stranger")
    wait_for_finding(file.relay, "other_type", naming=["/stranger", IMAGE, VECTOR, "/player"])
    # A group that begins shares what is there, and is fed by a publisher that returns.
    file.reload(front=_exact(*_PAIR), rear=_exact(*_PAIR))
    relaying.connect(stage.player(_PAIR, node="again"), collector, recording, _REAR)
    # With another QoS too, where the stranger would keep it from being taken again.
    file.reload(front={"policy": "exact_time", "topics": [{"topic": topic} for topic in _PAIR]})
    wait_until(lambda: _types(file.relay, "front") == [VECTOR, VECTOR], "the types that were taken")
    for topic in _PAIR:
        assert file.relay.stderr.count(f"{topic}: {VECTOR}, as ") == 1


@pytest.mark.parametrize("backend", ["rclpy"])
def test_what_keeps_a_type_from_being_taken_is_told_until_it_is_mended(stage: Stage):
    stage.before_each_relay(_SETTLES_SLOWLY)
    stranger = stage.player({"/camera": IMAGE}, node="stranger")
    player = stage.player({**_PAIR, "/text": STRING})
    collector = stage.collector(_FRONT)
    wait_until(lambda: len(collector.endpoints("/camera", kind="publisher")) == 2, "both publishers")
    groups = {
        "front": _exact("/camera", "/lidar"),
        "headless": _exact("/lidar", "/text"),
        "absent": _exact("/lidar", "/lidarr"),
    }
    file = ReloadedFile(stage, **groups)
    relay = file.relay
    wait_for_finding(relay, "several_types", naming=[IMAGE, "/stranger", VECTOR, "/player"])
    assert _types(relay, "front")[0] is None
    relay.wait_for_log("front: waiting for the type of /camera")
    wait_for_finding(relay, "no_publisher", "absent", naming=["/lidarr"])
    wait_for_finding(relay, "type_not_importable", "headless", naming=["/text", STRING])
    stranger.process.ask_to_end()
    assert_logged(relay, rf"/camera: {VECTOR}, as /player publishes it\n")
    wait_until(lambda: "several_types" not in findings(relay), "the end of the finding")
    by_arrival = {**_exact("/lidar", "/text", stamp="receive"), "policy": "approximate_time", "slop": "10ms"}
    file.reload(**groups | {"headless": by_arrival})
    relaying.connect(player, collector, merged(at("/camera", 0), at("/lidar", 0)), _FRONT)
