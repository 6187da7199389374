"""What a relay finds where DDS shows or hides something, which virtual time cannot play; see tests/scenarios too."""

import re
import signal
from typing import Any

import pytest

from tests.ros.cdr_messages import VECTOR, serialize
from tests.ros.processes import wait_until
from tests.ros.sensors import front, play, stream
from tests.ros.stage import Stage
from tests.ros.status import findings, get, page, status
from tests.ros.streams import merged

pytestmark = pytest.mark.ros


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
    counted = re.search(r'syncrelay_messages_lost_total\{group="front",topic="/camera"\} (\S+)', get(relay, "/metrics"))
    assert counted
    assert float(counted[1]) > 0


def test_probes_tell_a_relay_that_waits_from_one_that_is_ready(stage: Stage):
    relay = stage.relay(front())
    wait_until(lambda: page(relay, "/livez") == (200, "receiving\n"), "a relay that receives")
    wait_until(lambda: bool(findings(relay)), "a first look")
    assert status(relay)["relay"]["ready"] is False
    play(stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10)))
    wait_until(lambda: status(relay)["relay"]["ready"], "the relay to be ready")
    wait_until(lambda: page(relay, "/readyz") == (200, "ready\n"), "a probe that says so")
    assert 'syncrelay_messages_received_total{group="front",topic="/camera"}' in get(relay, "/metrics")


def test_nobody_is_missed_before_those_who_run_had_time_to_be_found(stage: Stage):
    """One that missed the first announcements is found at the next: up to 3 s after the start, and a little."""
    relay = stage.relay(front())
    seen: dict[str, Any] = {}

    def nobody_is_found() -> bool:
        seen.update(status(relay))
        codes = {each["code"] for group in seen["groups"] for each in group["findings"]}
        return not codes.isdisjoint({"alone", "no_publisher"})

    wait_until(nobody_is_found, "a finding that nobody is there")
    assert seen["relay"]["uptime_s"] > 3.5
