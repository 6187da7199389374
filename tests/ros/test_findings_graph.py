"""A working rig, broken where the graph shows it: the relay's log and its state say what is wrong."""

import signal

import pytest

from tests.ros.cdr_messages import CLOCK, IMAGE, VECTOR, serialize, time
from tests.ros.configs import inputs
from tests.ros.frames import Frame
from tests.ros.processes import wait_until
from tests.ros.sensors import BY_RECEIPT, LASTED, ON_AND_ON_MS, assert_logged, front, play, stream, wait_for_sets
from tests.ros.stage import Stage
from tests.ros.status import findings, first_group, get, page, status
from tests.ros.streams import BEGIN, MS, merged

pytestmark = pytest.mark.ros


def test_a_topic_that_nobody_publishes_is_named_with_the_one_that_was_meant(stage: Stage):
    topics = inputs({"/camra": VECTOR, "/lidar": VECTOR})
    relay = stage.relay(front(topics))
    camera = stage.player({"/camera": VECTOR})
    lidar = stage.player({"/lidar": VECTOR})
    lidar.match()
    assert_logged(
        relay,
        rf"\[WARN\] .* front: no set for {LASTED}: nobody publishes /camra \(geometry_msgs/msg/Vector3Stamped\);"
        r" did you mean `topic: /camera`\? It is published as geometry_msgs/msg/Vector3Stamped\n",
    )
    assert first_group(relay)["level"] == "stale"
    assert camera.process.running()


def test_a_publisher_of_another_type_is_named_with_both_types(stage: Stage):
    relay = stage.relay(front())
    stage.player({"/camera": IMAGE}, node="usb_cam")
    stage.player({"/lidar": VECTOR}).match()
    assert_logged(
        relay,
        rf"no set for {LASTED}: /usb_cam publishes /camera as sensor_msgs/msg/Image, the file says"
        r" geometry_msgs/msg/Vector3Stamped; write `type: sensor_msgs/msg/Image`\n",
    )


@pytest.mark.parametrize(
    ("policy", "offered", "requested"),
    [("reliability", "best_effort", "reliable"), ("durability", "volatile", "transient_local")],
)
def test_an_incompatible_qos_is_named_with_its_policy_and_its_node(
    stage: Stage, policy: str, offered: str, requested: str
):
    topics = [*inputs({"/camera": VECTOR}, qos={policy: requested}), *inputs({"/lidar": VECTOR})]
    relay = stage.relay(front(topics))
    stage.player({"/camera": VECTOR}, node="usb_cam", **{policy: offered})
    stage.player({"/lidar": VECTOR}).match()
    assert_logged(
        relay,
        rf"no set for {LASTED}: /usb_cam offers /camera with {policy} {offered}, the group requests {requested};"
        rf" write `qos: auto` at /camera, or have /usb_cam offer {requested}\n",
    )
    relay.wait_for_log("front: waiting for a publisher of /camera with compatible QoS")


def test_a_publisher_that_sends_nothing_is_named(stage: Stage):
    relay = stage.relay(front())
    stage.player({"/camera": VECTOR}, node="usb_cam").match()
    play(stage, stream("/lidar", hz=10))
    assert_logged(
        relay,
        rf"no set for {LASTED}: /usb_cam publishes /camera, but no message has arrived; check with"
        r" `ros2 topic hz /camera`",
    )


def test_a_topic_that_falls_silent_and_comes_back_is_told(stage: Stage):
    relay = stage.relay(front(BY_RECEIPT, slop="100ms"))
    play(stage, stream("/camera", hz=10), node="usb_cam")
    lidar = play(stage, stream("/lidar", hz=10), node="ouster")
    wait_for_sets(relay, 20)
    lidar.stop()
    assert_logged(
        relay,
        rf"no more sets for {LASTED}: /lidar has been silent for {LASTED}; before that its rate was [\d.]+ Hz;"
        r" check /ouster, which publishes it or has died: a dead node stays in the graph for 20 s\n",
    )
    lidar.start(stream("/lidar", hz=10), speed=1)
    assert_logged(relay, rf"\[INFO\] .* front: recovered after {LASTED}\n")


def test_a_node_that_dies_and_comes_back_is_told(stage: Stage):
    relay = stage.relay(front(BY_RECEIPT, slop="100ms"))
    play(stage, stream("/camera", hz=10))
    ouster = play(stage, stream("/lidar", hz=10), node="ouster")
    wait_for_sets(relay, 4)
    ouster.process.send(signal.SIGKILL)
    assert_logged(
        relay,
        rf"no more sets for {LASTED}: nobody publishes /lidar \(geometry_msgs/msg/Vector3Stamped\) any more; its"
        rf" last message arrived {LASTED} ago; restart the node that published /lidar\n",
    )
    play(stage, stream("/lidar", hz=10), node="ouster")
    assert_logged(relay, rf"front: recovered after {LASTED}\n")


def test_a_clock_that_stands_still_is_told(stage: Stage):
    relay = stage.relay(front(top={"node": {"use_sim_time": True}}))
    times = [BEGIN + n * MS for n in range(0, ON_AND_ON_MS, 50)]
    ticks = [Frame("/clock", CLOCK, each, serialize(CLOCK, time(each))) for each in times]
    player = play(stage, merged(ticks, stream("/camera", hz=10), stream("/lidar", hz=10)))
    wait_for_sets(relay, 10)
    player.stop()
    assert_logged(
        relay,
        rf"no more sets for {LASTED}: /clock has stood still for {LASTED}: nothing that waits expires; start or resume"
        r" what publishes /clock, or run without use_sim_time\n",
    )


def test_a_subscriber_that_gets_nothing_is_told(stage: Stage):
    relay = stage.relay(front())
    stage.collector({"/front/camera": VECTOR}, node="fusion", durability="transient_local")
    play(stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10)))
    assert_logged(
        relay,
        r"\[WARN\] .* front: /fusion requests /front/camera with durability transient_local, the relay offers volatile,"
        r" so it gets nothing; have /fusion request volatile, or /camera's publisher offer transient_local\n",
    )


def test_a_type_that_is_not_installed_is_told(stage: Stage):
    topics = [*inputs({"/camera": "fancy_msgs/msg/Fancy"}), *inputs({"/lidar": VECTOR})]
    relay = stage.relay(front(topics))
    stage.player({"/lidar": VECTOR}).match()
    assert_logged(relay, rf"no set for {LASTED}: /camera: .*fancy_msgs.*; install the package where the relay runs")


def test_probes_tell_a_relay_that_waits_from_one_that_is_ready(stage: Stage):
    relay = stage.relay(front())
    wait_until(lambda: page(relay, "/livez") == (200, "receiving\n"), "a relay that receives")
    wait_until(lambda: bool(findings(relay)), "a first look")
    assert status(relay)["relay"]["ready"] is False
    play(stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10)))
    wait_until(lambda: status(relay)["relay"]["ready"], "the relay to be ready")
    wait_until(lambda: page(relay, "/readyz") == (200, "ready\n"), "a probe that says so")
    assert 'syncrelay_messages_received_total{group="front",topic="/camera"}' in get(relay, "/metrics")
