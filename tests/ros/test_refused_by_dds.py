"""What DDS does not make is told as its group's, and others go on; a reload takes on all of a file or nothing."""

from typing import Any

import pytest

from syncrelay.sync import ExactTime
from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.processes import wait_until
from tests.ros.reloaded import ReloadedFile
from tests.ros.sensors import stream
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


def test_an_input_takes_the_topic_of_an_output_that_ends_and_an_output_that_of_an_input(stage: Stage):
    file, collector = ReloadedFile(stage, turned=_SWAP), stage.collector()
    _wait_for_outputs(collector, {"/o1": _IMU, "/o2": _FIELD})
    file.reload(turned=_group(("/o1", _FIELD, "/x"), ("/o2", _IMU, "/mag")))
    _wait_for_outputs(collector, {"/x": _FIELD, "/mag": _IMU})
    assert "refused_by_dds" not in findings(file.relay, "turned")


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


def test_a_file_with_an_output_that_dds_refuses_is_refused_and_the_running_groups_stay(stage: Stage):
    recording = merged(at("/camera", 0, 10, 20), at("/lidar", 0, 10, 20))
    stage.before_each_relay(_OTHERS)
    file = ReloadedFile(stage, front=_FRONT, swap=_SWAP)
    collector, player = stage.collector(_ALIGNED), stage.player(_PAIR)
    relaying.connect(player, collector, recording, _ALIGNED)
    _wait_for_outputs(collector, {"/o1": _IMU, "/o2": _FIELD})
    # The first output would have to end for the other group's, which could be made.
    third = _group(("/x", _IMU, "/taken"), ("/mag", _FIELD, "/o1"))
    why = file.refuse(config({"front": _FRONT, "swap": third}, metrics=ANY_PORT))
    assert why.startswith(f"the relay cannot publish /taken as {_IMU}: ")
    _wait_for_outputs(collector, {"/o1": _IMU, "/o2": _FIELD})
    player.play(recording)
    relaying.conclude(player, collector, recording, _ALIGNED)
    assert len(relaying.sets_within(recording, collector, _ALIGNED)) == 3


_FAILING = """
import syncrelay.explain as explain
from syncrelay.config import GroupConfig
from syncrelay.sync.group import SyncGroup

add, engine, judge, made = SyncGroup.add, GroupConfig.engine, explain.Judge.judge, {}

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

def failing_judge(self, facts):
    if facts.name == "unjudged":
        raise ZeroDivisionError("no rate")
    return judge(self, facts)

SyncGroup.add, GroupConfig.engine = failing_add, failing_engine
explain.Judge.judge = failing_judge
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


# The second message after there is a file of this name: that of the first set's second topic.
_FAILING_PUBLISH = """
import os
from ctypes import CFUNCTYPE, c_int, c_void_p, cast
from rclpy.impl.implementation_singleton import rclpy_implementation
from syncrelay.ros import rclpy_backend

calls = []

def fails():
    if os.path.exists("fail"):
        calls.append(1)
    return len(calls) == 2

send = rclpy_backend.RclpyOutlet.send_content

def failing_send(self, content):
    self._publisher = Failing(self._publisher)
    try:
        send(self, content)
    finally:
        self._publisher = self._publisher.publisher

class Failing:
    def __init__(self, publisher):
        self.publisher, self.handle = publisher, self

    def publish_raw(self, content):
        if fails():
            raise rclpy_implementation.RCLError("no room")
        self.publisher.handle.publish_raw(content)

rclpy_backend.RclpyOutlet.send_content = failing_send

try:
    from syncrelay.ros.compiled import backend
except ImportError:
    pass
else:
    prototype, addresses = CFUNCTYPE(c_int, c_void_p, c_void_p, c_void_p), backend.addresses
    publish = prototype(addresses()["rcl_publish_serialized_message"])

    @prototype
    def failing_publish(publisher, message, allocation):
        return 1 if fails() else publish(publisher, message, allocation)

    mine = {"rcl_publish_serialized_message": cast(failing_publish, c_void_p).value}
    backend.addresses = lambda: addresses() | mine
"""


@both_backends
def test_a_message_that_rcl_does_not_publish_is_told_and_the_next_ones_leave(stage: Stage):
    stage.before_each_relay(_FAILING_PUBLISH)
    recording = merged(*(at(topic, 0, 10, 20) for topic in _PAIR))
    relay = stage.relay(config({"front": _FRONT}, metrics=ANY_PORT))
    collector, player = stage.collector(_ALIGNED), stage.player(_PAIR)
    relaying.connect(player, collector, recording, _ALIGNED)
    relaying.conclude(player, collector, recording, _ALIGNED)
    before = {output: collector.count(output) for output in _ALIGNED}
    (stage.folder / "fail").touch()
    player.play(recording)
    relay.wait_for_log("front: a message could not be published on /front/lidar: ")
    relay.wait_for_log("front: publishing on /front/lidar again; 1 message was not published")
    assert "Traceback" not in relay.stderr
    collector.wait_for("/front/camera", before["/front/camera"] + 3)
    collector.wait_for("/front/lidar", before["/front/lidar"] + 2)


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


def test_a_group_that_cannot_be_judged_is_relayed_and_others_are_judged(stage: Stage):
    stage.before_each_relay(_FAILING)
    recording = merged(*(stream(topic, hz=10) for topic in _PAIR))
    relay = stage.relay(config({"unjudged": _FRONT, "front": _FRONT}, metrics=ANY_PORT))
    aligned = {**_ALIGNED, "/unjudged/camera": VECTOR, "/unjudged/lidar": VECTOR}
    collector, player = stage.collector(aligned), stage.player(_PAIR)
    relaying.connect(player, collector, recording, aligned)
    player.start(recording, speed=1)
    for output in aligned:
        collector.wait_for(output, collector.count(output) + 3)
    wait_for_finding(relay, "healthy")
    relay.wait_for_log("a bug in syncrelay while evaluating unjudged; the relay keeps running")
    assert relay.stderr.count("ZeroDivisionError: no rate") == 1
