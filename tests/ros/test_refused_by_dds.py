"""What DDS does not make is told as its group's, and others go on; a reload takes on all of a file or nothing."""

from typing import Any

import pytest

from syncrelay.sync import ExactTime
from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.processes import wait_until
from tests.ros.reloaded import ReloadedFile
from tests.ros.stage import Collector, Stage, both_backends
from tests.ros.status import ANY_PORT, findings, wait_for_finding
from tests.ros.streams import at, jittery, merged

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_ALIGNED = {"/front/camera": VECTOR, "/front/lidar": VECTOR}
_FRONT = {"policy": "exact_time", "queue_size": ROOMY, "topics": inputs(_PAIR, qos=LOSSLESS)}
_IMU, _FIELD = "sensor_msgs/msg/Imu", "sensor_msgs/msg/MagneticField"
# All that is needed to subscribe and to publish is here, so that nobody else has to.
_AT_ONCE = {"reliability": "reliable", "durability": "volatile"}


def _group(*topics: tuple[str, str, str]) -> dict[str, Any]:
    """A group of these topics, with their types and outputs."""
    named = [
        {"topic": topic, "type": type_name, "output": output, "qos": _AT_ONCE} for topic, type_name, output in topics
    ]
    return {"policy": "exact_time", "topics": named}


_SWAP = _group(("/x", _IMU, "/o1"), ("/mag", _FIELD, "/o2"))
_SWAPPED = _group(("/x", _IMU, "/o2"), ("/mag", _FIELD, "/o1"))


def _wait_for_outputs(collector: Collector, outputs: dict[str, str]) -> None:
    """Until the relay publishes these, as these types and no others."""

    def seen(output: str) -> list[str]:
        return [each["type"] for each in collector.endpoints(output, kind="publisher", node="/syncrelay")]

    wait_until(lambda: all(seen(output) == [name] for output, name in outputs.items()), f"{outputs}")


@both_backends
def test_a_reload_exchanges_the_outputs_of_two_types_and_other_groups_lose_nothing(stage: Stage):
    recording = merged(*(jittery(topic, period_ms=10, jitter_ms=0, count=600, seed=1) for topic in _PAIR))
    file = ReloadedFile(stage, front=_FRONT, swap=_SWAP)
    collector, player = stage.collector(_ALIGNED), stage.player(_PAIR)
    relaying.connect(player, collector, recording, _ALIGNED)
    player.start(recording, speed=2)
    for swap in (_SWAPPED, _SWAP, _SWAPPED, _SWAP):
        file.reload(front=_FRONT, swap=swap)
    player.finish()
    relaying.conclude(player, collector, recording, _ALIGNED)
    expected = relaying.expected_sets(ExactTime(n_inputs=2, queue_size=ROOMY), recording, list(_PAIR))
    assert relaying.sets_within(recording, collector, _ALIGNED) == expected
    file.reload(front=_FRONT, swap=_SWAPPED)
    _wait_for_outputs(collector, {"/o2": _IMU, "/o1": _FIELD})


# Others may run in the relay's process, as a plugin does, and Fast DDS has one type for each of its topics.
_OTHERS = """
import rclpy

create_node = rclpy.create_node

def create_node_with_others(*words, **named):
    from rcl_interfaces.msg import Log, ParameterEvent

    node = create_node(*words, **named)
    for message_type, topic in ((ParameterEvent, "/taken"), (Log, "/z")):
        node.create_publisher(message_type, topic, 1)
    return node

rclpy.create_node = create_node_with_others
"""


@both_backends
def test_what_dds_refuses_is_a_finding_of_its_group_and_others_go_on(stage: Stage):
    recording = merged(at("/camera", 0, 10, 20), at("/lidar", 0, 10, 20))
    stage.before_each_relay(_OTHERS)
    outputs = _group(("/x", _IMU, "/taken"), ("/mag", _FIELD, "/o2"))
    subscriptions = _group(("/y", _IMU, "/o3"), ("/z", _FIELD, "/o4"))
    file = ReloadedFile(stage, front=_FRONT, outputs=outputs, subscriptions=subscriptions)
    collector, player = stage.collector(_ALIGNED), stage.player(_PAIR)
    relaying.connect(player, collector, recording, _ALIGNED)
    player.play(recording)
    relaying.conclude(player, collector, recording, _ALIGNED)
    assert len(relaying.sets_within(recording, collector, _ALIGNED)) == 3
    for name, topic, naming in (
        ("outputs", "/x", ["/taken", _IMU, "rcl_interfaces/msg/ParameterEvent"]),
        ("subscriptions", "/z", ["/z", _FIELD, "rcl_interfaces/msg/Log"]),
    ):
        finding = wait_for_finding(file.relay, "refused_by_dds", name, naming=naming)
        assert (finding["severity"], finding["topic"]) == ("error", topic)
    assert "refused_by_dds" not in findings(file.relay)
    # rcl's own lines would come at every try.
    assert ">>> [rcutils" not in file.relay.stderr


_FAILING = """
from syncrelay.config import GroupConfig
from syncrelay.sync.group import SyncGroup

add, engine, made = SyncGroup.add, GroupConfig.engine, {}

def failing_add(self, message, *, now):
    if message.stamp % 1000 == 7 and self._is_limited:
        raise KeyError(message.stamp)
    return add(self, message, now=now)

def failing_engine(self):
    # One is made for the group, and later one for those who watch it, when it has taken the place of another.
    made[self.name] = made.get(self.name, 0) + 1
    if self.name == "impossible" or (self.name == "half_possible" and made[self.name] == 2):
        raise OverflowError("too large to be an engine")
    return engine(self)

SyncGroup.add, GroupConfig.engine = failing_add, failing_engine
"""


@both_backends
def test_a_bug_stops_its_group_until_a_reload_and_others_on_the_same_topics_go_on(stage: Stage):
    stage.before_each_relay(_FAILING)
    recording = merged(*(at(topic, 0, 10, 20.000007, 30) for topic in _PAIR))
    failing = {**_FRONT, "max_wait": "1s"}
    of_failing = {"/failing/camera": VECTOR, "/failing/lidar": VECTOR}
    aligned = {**_ALIGNED, **of_failing}
    file = ReloadedFile(stage, front=_FRONT, failing=failing)
    collector, player = stage.collector(aligned), stage.player(_PAIR)
    relaying.connect(player, collector, recording, aligned)
    player.play(recording)
    relaying.conclude(player, collector, recording, _ALIGNED)
    assert len(relaying.sets_within(recording, collector, _ALIGNED)) == 4
    wait_for_finding(file.relay, "internal_error", "failing", naming=["KeyError: "])
    assert "internal_error" not in findings(file.relay)
    assert file.relay.stderr.count("Traceback") == 1
    file.reload(front=_FRONT, failing=failing)
    file.relay.wait_for_log("reloaded: 1 group unchanged; ")
    relaying.conclude(player, collector, recording, of_failing)
    assert [len(relaying.within(recording, collector.payloads(each))) for each in of_failing] == [2, 2]


@pytest.mark.parametrize("name", ["impossible", "half_possible"])
def test_a_bug_that_a_file_finds_leaves_the_relay_with_its_old_file(stage: Stage, name: str):
    stage.before_each_relay(_FAILING)
    recording = merged(at("/camera", 0, 10, 20), at("/lidar", 0, 10, 20))
    file = ReloadedFile(stage, front=_FRONT, swap=_SWAP)
    collector, player = stage.collector(_ALIGNED), stage.player(_PAIR)
    relaying.connect(player, collector, recording, _ALIGNED)
    _wait_for_outputs(collector, {"/o1": _IMU, "/o2": _FIELD})
    why = file.refuse(config({"front": _FRONT, "swap": _SWAPPED, name: _FRONT}, metrics=ANY_PORT))
    # A traceback may quote the file, so it is in the log alone.
    assert why == "reload failed because of a bug in syncrelay, OverflowError; see the relay's log"
    assert "reload failed because of a bug in syncrelay; keeping the running configuration; please" in file.relay.stderr
    assert file.relay.stderr.count("OverflowError: too large to be an engine") == 1
    player.play(recording)
    relaying.conclude(player, collector, recording, _ALIGNED)
    assert len(relaying.sets_within(recording, collector, _ALIGNED)) == 3
    _wait_for_outputs(collector, {"/o1": _IMU, "/o2": _FIELD})
    file.reload(front=_FRONT, rear=_SWAP)
