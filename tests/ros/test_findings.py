"""A working rig, and one whose flow is broken: the relay's log and its state say what is wrong."""

import re
import signal
from typing import Any

import pytest

from tests.ros.cdr_messages import VECTOR, serialize
from tests.ros.configs import LOSSLESS, config, inputs
from tests.ros.processes import comes_true, wait_until
from tests.ros.sensors import (
    APPROXIMATE,
    BY_RECEIPT,
    LASTED,
    OF_A_BUSY_MACHINE,
    PAIR,
    assert_logged,
    front,
    logged_findings,
    play,
    stream,
)
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT, first_group, status, wait_for_finding
from tests.ros.streams import merged

pytestmark = pytest.mark.ros


def test_a_working_rig_is_healthy_and_nothing_is_said(stage: Stage):
    relay = stage.relay(front(), "--log-format", "json")
    collector = stage.collector({"/front/camera": VECTOR, "/front/lidar": VECTOR})
    play(stage, merged(stream("/camera", hz=20), stream("/lidar", hz=10, shift_ms=7)))
    collector.wait_for("/front/camera", 150)
    wait_until(lambda: first_group(relay)["level"] == "ok", "a group in order")
    wait_for_finding(
        relay,
        "healthy",
        text=r"[\d.]+ of [\d.]+ possible sets a second, span 7 ms and latency [\d.]+ [mu]?s at the 95th percentile",
    )
    assert logged_findings(relay) <= OF_A_BUSY_MACHINE


def test_a_queue_too_short_beside_a_fast_imu_is_told_with_one_that_fits(stage: Stage):
    topics = inputs({"/camera": VECTOR, "/imu": VECTOR})
    relay = stage.relay(front(topics, queue_size=2))
    play(stage, merged(stream("/camera", hz=5, late_ms=100), stream("/imu", hz=200)))
    wait_for_finding(
        relay,
        "short_queue",
        text=r"(\d+ of the last|all) \d+ messages of /imu overflowed its queue of 2 before their partners came",
        suggestion=r"write `queue_size: \d+`, which would give \d+ of \d+ possible sets \(now \d+\)",
    )


def test_an_optional_input_that_nobody_publishes_is_told_by_that_alone(stage: Stage):
    topics = [*inputs(PAIR), *inputs({"/imu": VECTOR}, required=False)]
    relay = stage.relay(front(topics, max_wait="100ms"))
    play(stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10)))
    assert_logged(relay, r"\[WARN\] .* front: nobody publishes /imu ")
    assert "waiting_for_optional" not in {each["code"] for each in first_group(relay)["findings"]}


def test_an_input_that_slows_down_is_told_and_its_recovery_too(stage: Stage):
    relay = stage.relay(front(BY_RECEIPT, slop="500ms"))
    play(stage, stream("/lidar", hz=20))
    usb_cam = stage.player({"/camera": VECTOR}, node="usb_cam")
    usb_cam.match()
    slowed = (
        r"\[WARN\] .* front: /camera has slowed from [\d.]+ Hz to [\d.]+ Hz; check /usb_cam: its settings, its load,"
        r" and the network to it\n"
    )
    for seconds in (13, 30, 60):
        usb_cam.play(stream("/camera", hz=20, last_ms=1000 * seconds), speed=1)
        usb_cam.start(stream("/camera", hz=2), speed=1)
        # A machine that holds messages up all the time lets no pace be known to fall from.
        if comes_true(lambda: re.search(slowed, relay.stderr), within_s=30):
            break
        usb_cam.stop()
    assert_logged(relay, slowed)
    usb_cam.stop()
    usb_cam.start(stream("/camera", hz=20), speed=1)
    assert_logged(relay, rf"\[INFO\] .* front: resolved {LASTED} ago: /camera has slowed")


def test_a_relay_that_stood_still_is_told(stage: Stage):
    relay = stage.relay(front())
    collector = stage.collector({"/camera": VECTOR})
    play(stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10)))
    wait_for_finding(relay, "healthy")
    relay.send(signal.SIGSTOP)
    collector.wait_for("/camera", collector.count("/camera") + 30)
    relay.send(signal.SIGCONT)
    wait_for_finding(relay, "too_slow", text=rf"messages waited up to {LASTED} for the relay")


def test_messages_that_dds_lost_while_the_relay_stood_still_are_counted_and_the_relay_is_blamed(stage: Stage):
    # What a socket cannot hold is lost for certain, what shared memory cannot hold only sometimes.
    stage.environment["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"
    relay = stage.relay(front(slop="10s"))
    collector = stage.collector({"/camera": VECTOR}, reliability="best_effort")
    fast = stream("/camera", hz=50)

    def camera() -> dict[str, Any]:
        return next((group["inputs"][0] for group in status(relay)["groups"]), {"received": 0})

    big = serialize("std_msgs/msg/String", "x" * 10_000)
    play(stage, stream("/lidar", hz=10))
    play(stage, [frame._replace(payload=frame.payload + big) for frame in fast], reliability="best_effort")
    # What is lost in a publisher's first looks is what it sent before it was heard.
    wait_until(lambda: camera()["received"] > 200, "messages of four seconds")
    lost = camera()["lost"]
    relay.send(signal.SIGSTOP)
    sent = collector.count("/camera")
    collector.wait_for("/camera", sent + 100)
    relay.send(signal.SIGCONT)
    said: set[str] = set()

    def is_blamed() -> bool:
        nonlocal said
        (group,) = status(relay)["groups"]
        said = {each["code"] for each in group["findings"]}
        return "too_slow" in said and group["inputs"][0]["lost"] > lost

    wait_until(is_blamed, "a relay that is too slow, and losses that are counted")
    assert "messages_lost" not in said


def test_a_relay_that_cannot_keep_up_is_told(stage: Stage):
    group = {**APPROXIMATE, "topics": inputs(PAIR, qos=LOSSLESS)}
    many = {"front": group, **{f"front_{number}": group for number in range(60)}}
    relay = stage.relay(config(many, metrics=ANY_PORT))
    play(stage, merged(stream("/camera", hz=200), stream("/lidar", hz=200)))
    wait_for_finding(relay, "too_slow", text=rf"messages waited up to {LASTED} for the relay")
