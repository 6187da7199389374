"""A working rig, broken in every way that the relay has a word for: its log and its state say what is wrong."""

import re
import signal
from collections.abc import Mapping, Sequence
from typing import Any

import pytest

from tests.ros.cdr_messages import CLOCK, IMAGE, VECTOR, serialize, time, vector, with_stamp
from tests.ros.configs import LOSSLESS, config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.stage import Player, Stage
from tests.ros.status import ANY_PORT, findings, get, status, wait_for_finding
from tests.ros.streams import BEGIN, MS, at, merged

pytestmark = pytest.mark.ros

PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
APPROXIMATE = {"policy": "approximate_time", "slop": "20ms"}
MINUTE = 60_000
# Nodes that begin at different times play together all the same.
BY_RECEIPT = inputs(PAIR, stamp="receive")


def front(topics: Sequence[Mapping[str, Any]] | None = None, top: Mapping[str, Any] | None = None, **keys: Any) -> str:
    """One group of camera and lidar, whose relay says its state on a port of its own."""
    group = {**APPROXIMATE, **keys, "topics": topics or inputs(PAIR)}
    return config({"front": group}, **{"metrics": ANY_PORT, **(top or {})})


def stream(topic: str, *, hz: float, late_ms: float = 0, shift_ms: float = 0, last_ms: float = MINUTE) -> list[Frame]:
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


def assert_logged(relay: Process, pattern: str) -> None:
    """A line of the log holds the pattern, sooner or later."""
    relay.wait_until(lambda: re.search(pattern, relay.stderr) is not None, f"{pattern!r} in the log")


def test_a_working_rig_is_healthy_and_nothing_is_said(stage: Stage):
    relay = stage.relay(front())
    collector = stage.collector({"/front/camera": VECTOR, "/front/lidar": VECTOR})
    play(stage, merged(stream("/camera", hz=20), stream("/lidar", hz=10, shift_ms=7)))
    collector.wait_for("/front/camera", 150)
    assert list(findings(relay)) == ["healthy"]
    assert re.fullmatch(
        r"[\d.]+ of [\d.]+ possible sets a second, span 7 ms and latency [\d.]+ m?s at the 95th percentile",
        findings(relay)["healthy"]["text"],
    )
    assert not [line for line in relay.said if not line.startswith("[INFO]")]
    assert status(relay)["groups"][0]["level"] == "ok"


def test_a_topic_that_nobody_publishes_is_named_with_the_one_that_was_meant(stage: Stage):
    topics = inputs({"/camra": VECTOR, "/lidar": VECTOR})
    relay = stage.relay(front(topics))
    camera = stage.player({"/camera": VECTOR})
    lidar = stage.player({"/lidar": VECTOR})
    lidar.match()
    assert_logged(
        relay,
        r"\[WARN\] .* front: no set for [\d.]+ s: nobody publishes /camra \(geometry_msgs/msg/Vector3Stamped\);"
        r" did you mean `topic: /camera`\? It is published as geometry_msgs/msg/Vector3Stamped\n",
    )
    assert status(relay)["groups"][0]["level"] == "stale"
    assert camera.process.running()


def test_a_publisher_of_another_type_is_named_with_both_types(stage: Stage):
    relay = stage.relay(front())
    stage.player({"/camera": IMAGE}, node="usb_cam")
    stage.player({"/lidar": VECTOR}).match()
    assert_logged(
        relay,
        r"no set for [\d.]+ s: /usb_cam publishes /camera as sensor_msgs/msg/Image, the file says"
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
        rf"no set for [\d.]+ s: /usb_cam offers /camera with {policy} {offered}, the group requests {requested};"
        rf" write `qos: auto` at /camera, or have /usb_cam offer {requested}\n",
    )
    assert "front: waiting for a publisher of /camera whose QoS fits" in relay.stderr


def test_a_publisher_that_sends_nothing_is_named(stage: Stage):
    relay = stage.relay(front())
    stage.player({"/camera": VECTOR}, node="usb_cam").match()
    play(stage, stream("/lidar", hz=10))
    assert_logged(
        relay,
        r"no set for [\d.]+ s: /usb_cam publishes /camera, but no message has come; see with `ros2 topic hz /camera`",
    )


def test_a_topic_that_falls_silent_and_comes_back_is_told(stage: Stage):
    relay = stage.relay(front(BY_RECEIPT, slop="100ms"))
    play(stage, stream("/camera", hz=10), node="usb_cam")
    lidar = play(stage, stream("/lidar", hz=10, last_ms=3000), node="ouster")
    assert_logged(
        relay,
        r"no more sets for [\d.]+ s: /lidar has been silent for [\d.]+ s; until then it came at [\d.]+ Hz;"
        r" look at /ouster, which publishes it, or died: the graph shows a dead node for 20 s\n",
    )
    lidar.finish()
    lidar.start(stream("/lidar", hz=10), speed=1)
    assert_logged(relay, r"\[INFO\] .* front: sets leave again, after [\d.]+ s\n")


def test_a_node_that_dies_and_comes_back_is_told(stage: Stage):
    relay = stage.relay(front(BY_RECEIPT, slop="100ms"))
    play(stage, stream("/camera", hz=10))
    ouster = play(stage, stream("/lidar", hz=10), node="ouster")
    wait_until(lambda: status(relay)["groups"] and status(relay)["groups"][0]["sets"] > 3, "some sets")
    ouster.process.send(signal.SIGKILL)
    assert_logged(
        relay,
        r"no more sets for [\d.]+ s: nobody publishes /lidar \(geometry_msgs/msg/Vector3Stamped\) any more, since"
        r" [\d.]+ s; restart the node that published /lidar\n",
    )
    play(stage, stream("/lidar", hz=10), node="ouster")
    assert_logged(relay, r"front: sets leave again, after [\d.]+ s\n")


def test_stamps_of_zero_are_told(stage: Stage):
    relay = stage.relay(front())
    unset = [frame._replace(payload=with_stamp(frame.payload, 0)) for frame in stream("/camera", hz=10)]
    play(stage, merged(unset, stream("/lidar", hz=10)), node="usb_cam")
    assert_logged(
        relay,
        r"no set for [\d.]+ s: all \d+ messages of /camera have stamp 0; have /usb_cam set header.stamp, or write"
        r" `stamp: receive` at /camera\n",
    )


def test_a_camera_of_another_clock_is_told_with_its_offset(stage: Stage):
    relay = stage.relay(front())
    play(stage, merged(stream("/camera", hz=10, shift_ms=-37_200), stream("/lidar", hz=10)))
    assert_logged(
        relay,
        r"no set for [\d.]+ s: stamps of /camera are 37.2 s behind those of /lidar; synchronize the clocks of their"
        r" machines, or write `offset: 37.\d+s` at /camera\n",
    )


def test_a_slop_that_is_a_millisecond_too_small_is_told_with_one_that_fits(stage: Stage):
    relay = stage.relay(front())
    play(stage, merged(stream("/camera", hz=5), stream("/lidar", hz=5, shift_ms=21)))
    assert_logged(
        relay,
        r"no set for [\d.]+ s: the nearest sets span 21 ms, over slop 20 ms; write `slop: 22ms`, which would match"
        r" 99 %\n",
    )


def test_stamps_that_are_not_equal_are_told_to_exact_time(stage: Stage):
    text = config({"front": {"policy": "exact_time", "topics": inputs(PAIR)}}, metrics=ANY_PORT)
    relay = stage.relay(text)
    play(stage, merged(stream("/camera", hz=5), stream("/lidar", hz=5, shift_ms=0.014)))
    assert_logged(
        relay,
        r"no set for [\d.]+ s: no stamps are equal: the nearest sets span 14 us; write `policy: approximate_time` and"
        r" `slop: 14us`, which would match 99 %\n",
    )


def test_some_sets_over_slop_are_a_warning(stage: Stage):
    relay = stage.relay(front())
    near, far = stream("/lidar", hz=5), stream("/lidar", hz=5, shift_ms=30)
    mixed = [pair[n % 2] for n, pair in enumerate(zip(near, far, strict=True))]
    play(stage, merged(stream("/camera", hz=5), mixed))
    assert_logged(
        relay,
        r"\[WARN\] .* front: \d+ % of the last \d+ messages of /(camera|lidar) were farther from their partners than"
        r" slop 20 ms; write `slop: 30ms`, which would match 99 %\n",
    )


def test_a_queue_too_short_beside_a_fast_imu_is_told_with_one_that_fits(stage: Stage):
    topics = inputs({"/camera": VECTOR, "/imu": VECTOR})
    relay = stage.relay(front(topics, queue_size=2))
    play(stage, merged(stream("/camera", hz=5, late_ms=100), stream("/imu", hz=200)))
    finding = wait_for_finding(relay, "short_queue")
    assert re.fullmatch(
        r"(\d+ of the last|all) \d+ messages of /imu overflowed its queue of 2 before their partners came",
        finding["text"],
    )
    assert re.fullmatch(r"write `queue_size: (\d+)`", finding["suggestion"])


def test_sets_that_leave_without_an_optional_input_are_told(stage: Stage):
    topics = [*inputs(PAIR), *inputs({"/imu": VECTOR}, required=False)]
    relay = stage.relay(front(topics, max_wait="100ms"))
    play(stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10)))
    assert_logged(relay, r"\[WARN\] .* front: nobody publishes /imu ")
    assert_logged(
        relay,
        r"\[WARN\] .* front: 100 % of the sets leave without /imu after waiting 100 ms for it; see why /imu does not"
        r" come in time, or write a larger `max_wait`\n",
    )


def test_an_optional_input_whose_stamps_fit_no_set_is_told_with_the_slop_that_would_do(stage: Stage):
    topics = [*inputs(PAIR), *inputs({"/imu": VECTOR}, required=False)]
    relay = stage.relay(front(topics, max_wait="100ms"))
    play(
        stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10), stream("/imu", hz=10, late_ms=3, shift_ms=-37))
    )
    assert_logged(
        relay,
        r"\[WARN\] .* front: 100 % of the sets leave without /imu after waiting 100 ms for it: the nearest sets with it"
        r" span 37 ms to 37 ms, over slop 20 ms; write `slop: 40ms`, which would take in 99 %\n",
    )


def test_an_input_that_slows_down_is_told_and_its_recovery_too(stage: Stage):
    relay = stage.relay(front(BY_RECEIPT, slop="500ms"))
    play(stage, stream("/lidar", hz=20))
    usb_cam = stage.player({"/camera": VECTOR}, node="usb_cam")
    usb_cam.match()
    usb_cam.play(stream("/camera", hz=20, last_ms=13_000), speed=1)
    usb_cam.start(stream("/camera", hz=2, last_ms=16_000), speed=1)
    assert_logged(
        relay,
        r"\[WARN\] .* front: /camera comes at 2(\.\d+)? Hz, it came at (20|19\.\d|20\.\d) Hz; look at /usb_cam: its"
        r" settings, its load, and the network on the way\n",
    )
    usb_cam.finish()
    usb_cam.start(stream("/camera", hz=20, last_ms=25_000), speed=1)
    assert_logged(relay, r"\[INFO\] .* front: over for [\d.]+ s: /camera comes at 2(\.\d+)? Hz, it came at ")


def test_a_relay_that_stood_still_is_told(stage: Stage):
    relay = stage.relay(front())
    collector = stage.collector({"/camera": VECTOR})
    play(stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10)))
    wait_for_finding(relay, "healthy")
    relay.send(signal.SIGSTOP)
    collector.wait_for("/camera", collector.count("/camera") + 30)
    relay.send(signal.SIGCONT)
    finding = wait_for_finding(relay, "too_slow")
    assert re.fullmatch(r"messages lay here for [\d.]+ s before the relay came to them", finding["text"])


def test_a_recording_that_is_looped_is_told_without_blame(stage: Stage):
    relay = stage.relay(front())
    recording = merged(stream("/camera", hz=10, last_ms=3000), stream("/lidar", hz=10, last_ms=3000))
    player = stage.player(PAIR)
    player.match()
    for _ in range(2):
        player.play(recording, speed=1)
    finding = wait_for_finding(relay, "time_jump")
    assert re.fullmatch(r"stamps of /(camera|lidar) fell by 2.9 s [\d.]+ s ago: the group began anew", finding["text"])
    assert finding["severity"] == "ok"


def test_a_clock_that_stands_still_is_told(stage: Stage):
    relay = stage.relay(front(top={"node": {"use_sim_time": True}}))
    ticks = [Frame("/clock", CLOCK, BEGIN + n * MS, serialize(CLOCK, time(BEGIN + n * MS))) for n in range(0, 3000, 50)]
    sensors = merged(stream("/camera", hz=10, last_ms=3000), stream("/lidar", hz=10, last_ms=3000))
    play(stage, merged(ticks, sensors))
    assert_logged(
        relay,
        r"no more sets for [\d.]+ s: /clock has stood still for [\d.]+ s: nothing that waits expires; start or resume"
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


def test_two_nodes_on_one_topic_are_told_by_the_order_of_their_stamps(stage: Stage):
    relay = stage.relay(front())
    usb_cam, other_cam = stage.player(PAIR, node="usb_cam"), stage.player({"/camera": VECTOR}, node="other_cam")
    usb_cam.match()
    other_cam.match()
    usb_cam.start(merged(stream("/camera", hz=10), stream("/lidar", hz=10)), speed=1)
    other_cam.start(stream("/camera", hz=10, shift_ms=-350), speed=1)
    out_of = wait_for_finding(relay, "out_of_order")
    assert re.fullmatch(
        r"\d+ of the last \d+ messages of /camera came out of the order of their stamps", out_of["text"]
    )
    assert re.fullmatch(r"2 publish it, /\w+ and /\w+: give each a topic of its own", out_of["suggestion"])


def test_stamps_that_repeat_are_told(stage: Stage):
    relay = stage.relay(front())
    twice = [frame for frame in stream("/camera", hz=10) for _ in range(2)]
    play(stage, merged(twice, stream("/lidar", hz=10)), node="usb_cam")
    finding = wait_for_finding(relay, "duplicates")
    assert re.fullmatch(r"\d+ of the last \d+ messages of /camera repeat the stamp before them", finding["text"])
    assert finding["suggestion"] == "see how /usb_cam stamps its messages"


def test_messages_that_are_cut_short_are_told(stage: Stage):
    relay = stage.relay(front())
    short = [frame._replace(payload=frame.payload[:8]) for frame in stream("/camera", hz=10)]
    play(stage, merged(short, stream("/lidar", hz=10)), node="usb_cam")
    assert_logged(
        relay,
        r"no set for [\d.]+ s: all \d+ messages of /camera are cut short, or not of its type; see that /usb_cam has the"
        r" same version of geometry_msgs/msg/Vector3Stamped as is installed here\n",
    )


def _keyed(topic: str, key: str, *, hz: float = 10) -> list[Frame]:
    """Messages whose frame_id is the key and a running number."""
    return [
        frame._replace(payload=vector(BEGIN + n * MS, frame_id=f"{key}{n}"))
        for n, frame in enumerate(stream(topic, hz=hz))
    ]


EQUAL_KEY = {"policy": "equal_key", "key": "header.frame_id"}


def test_inputs_without_a_common_key_are_told_with_their_keys(stage: Stage):
    text = config({"front": {**EQUAL_KEY, "topics": inputs(PAIR)}}, metrics=ANY_PORT)
    relay = stage.relay(text)
    play(stage, merged(_keyed("/camera", "c"), _keyed("/lidar", "l")))
    assert_logged(
        relay,
        r"no set for [\d.]+ s: no key came on all inputs while it was buffered; the newest are 'c\d+' of /camera,"
        r" 'l\d+' of /lidar; correct `key`",
    )


def test_far_fewer_sets_than_possible_are_told(stage: Stage):
    text = config({"front": {**EQUAL_KEY, "topics": inputs(PAIR)}}, metrics=ANY_PORT)
    relay = stage.relay(text)
    half = [pair[n % 2] for n, pair in enumerate(zip(_keyed("/lidar", "l"), _keyed("/lidar", "k"), strict=True))]
    play(stage, merged(_keyed("/camera", "k"), half))
    finding = wait_for_finding(relay, "few_sets")
    assert re.fullmatch(
        r"[\d.]+ of [\d.]+ possible sets a second leave; of /(camera|lidar)'s last \d+ messages .*", finding["text"]
    )


def test_a_drifting_clock_is_told_in_ppm(stage: Stage):
    relay = stage.relay(front(slop="1s"))
    drifting = [
        frame._replace(payload=vector(BEGIN + round((frame.time - BEGIN) * 0.998)))
        for frame in stream("/camera", hz=20)
    ]
    play(stage, merged(drifting, stream("/lidar", hz=20)))
    finding = wait_for_finding(relay, "clock_drift")
    found = re.fullmatch(
        r"stamps of /camera lose [\d.]+ ms a second against those of /lidar \(([\d.]+) ppm\)", finding["text"]
    )
    assert found is not None
    assert 1500 < float(found[1]) < 2500


def test_messages_that_dds_lost_are_told(stage: Stage):
    # What a socket cannot hold is lost for certain, what shared memory cannot hold only sometimes.
    stage.environment["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"
    relay = stage.relay(front(slop="10s"))
    collector = stage.collector({"/camera": VECTOR}, reliability="best_effort")
    fast = stream("/camera", hz=500, last_ms=20_000)
    big = serialize("std_msgs/msg/String", "x" * 40_000)
    play(stage, stream("/lidar", hz=10))
    play(stage, [frame._replace(payload=frame.payload + big) for frame in fast], reliability="best_effort")
    # What is lost in a publisher's first looks is what it sent before it was heard.
    wait_until(lambda: status(relay)["groups"][0]["inputs"][0]["received"] > 1500, "messages of three seconds")
    relay.send(signal.SIGSTOP)
    sent = collector.count("/camera")
    collector.wait_for("/camera", sent + 500)
    relay.send(signal.SIGCONT)
    finding = wait_for_finding(relay, "messages_lost")
    assert re.fullmatch(r"DDS lost \d+ messages of /camera on the way here in the last 10 s", finding["text"])


def test_a_relay_that_cannot_keep_up_is_told(stage: Stage):
    group = {**APPROXIMATE, "topics": inputs(PAIR, qos=LOSSLESS)}
    many = {"front": group, **{f"front_{number}": group for number in range(60)}}
    relay = stage.relay(config(many, metrics=ANY_PORT))
    play(stage, merged(stream("/camera", hz=200), stream("/lidar", hz=200)))
    finding = wait_for_finding(relay, "too_slow")
    assert re.fullmatch(r"messages lay here for [\d.]+ m?s before the relay came to them", finding["text"])


def test_a_type_that_is_not_installed_is_told(stage: Stage):
    topics = [*inputs({"/camera": "fancy_msgs/msg/Fancy"}), *inputs({"/lidar": VECTOR})]
    relay = stage.relay(front(topics))
    stage.player({"/lidar": VECTOR}).match()
    assert_logged(relay, r"no set for [\d.]+ s: /camera: .*fancy_msgs.*; install the package where the relay runs")


def test_probes_tell_a_relay_that_waits_from_one_that_is_ready(stage: Stage):
    relay = stage.relay(front())
    assert get(relay, "/livez") == "receiving\n"
    wait_until(lambda: bool(findings(relay)), "a first look")
    assert status(relay)["relay"]["ready"] is False
    play(stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10)))
    wait_until(lambda: status(relay)["relay"]["ready"], "the relay to be ready")
    assert get(relay, "/readyz") == "ready\n"
    assert 'syncrelay_messages_received_total{group="front",topic="/camera"}' in get(relay, "/metrics")
