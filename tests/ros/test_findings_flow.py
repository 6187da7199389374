"""A working rig, and one whose flow is broken: the relay's log and its state say what is wrong."""

import re
import signal
from collections.abc import Iterator
from typing import Any

import pytest

from tests.ros.cdr_messages import VECTOR, serialize
from tests.ros.configs import LOSSLESS, config, inputs
from tests.ros.domain import claimed_domain
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.sensors import APPROXIMATE, LASTED, OF_A_BUSY_MACHINE, PAIR, front, play, stream, warnings_of
from tests.ros.stage import Collector, Stage, running_stage
from tests.ros.status import ANY_PORT, get, groups_of, status, wait_for_finding
from tests.ros.streams import merged

pytestmark = pytest.mark.ros

# What a group of this name is, and what its topics send; the optional one is sent by nobody.
RIGS: dict[str, tuple[dict[str, Any], tuple[list[Frame], ...]]] = {
    "well": (
        {**APPROXIMATE, "topics": inputs({"/well/camera": VECTOR, "/well/lidar": VECTOR})},
        (stream("/well/camera", hz=20), stream("/well/lidar", hz=10, shift_ms=7)),
    ),
    "beside_an_imu": (
        {**APPROXIMATE, "queue_size": 2, "topics": inputs({"/late/camera": VECTOR, "/late/imu": VECTOR})},
        (stream("/late/camera", hz=5, late_ms=100), stream("/late/imu", hz=200)),
    ),
    "with_optional": (
        {
            **APPROXIMATE,
            "max_wait": "100ms",
            "topics": [
                *inputs({"/dull/camera": VECTOR, "/dull/lidar": VECTOR}),
                *inputs({"/imu": VECTOR}, required=False),
            ],
        },
        (stream("/dull/camera", hz=10), stream("/dull/lidar", hz=10)),
    ),
}


@pytest.fixture(scope="module")
def rigs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Process, Collector]]:
    """A relay of all rigs, and a collector of what leaves the one that is well."""
    with claimed_domain() as domain, running_stage(tmp_path_factory.mktemp("rigs"), domain) as stage:
        groups = {name: group for name, (group, _) in RIGS.items()}
        relay = stage.relay(config(groups, metrics=ANY_PORT), "--log-format", "json")
        collector = stage.collector({"/well/well/camera": VECTOR, "/well/well/lidar": VECTOR})
        play(stage, merged(*(frames for _, streams in RIGS.values() for frames in streams)))
        yield relay, collector


def test_a_working_rig_is_healthy_and_nothing_is_said(rigs: tuple[Process, Collector]):
    relay, collector = rigs
    collector.wait_for("/well/well/camera", 150)
    wait_until(lambda: groups_of(relay)["well"]["level"] == "ok", "a group in order")
    wait_for_finding(
        relay,
        "healthy",
        "well",
        text=r"[\d.]+ of [\d.]+ possible sets a second, span 7 ms and latency [\d.]+ [mu]?s at the 95th percentile",
    )
    assert {line.get("finding") for line in warnings_of(relay, "well")} <= OF_A_BUSY_MACHINE


def test_a_queue_too_short_beside_a_fast_imu_is_told_with_one_that_fits(rigs: tuple[Process, Collector]):
    relay, _ = rigs
    wait_for_finding(
        relay,
        "short_queue",
        "beside_an_imu",
        text=r"(\d+ of the last|all) \d+ messages of /late/imu overflowed its queue of 2 before their partners came",
        suggestion=r"write `queue_size: \d+`, which would give \d+ of \d+ possible sets \(now \d+\)",
    )


def test_an_optional_input_that_nobody_publishes_is_told_by_that_alone(rigs: tuple[Process, Collector]):
    relay, _ = rigs
    relay.wait_until(
        lambda: any(
            line["message"].startswith("with_optional: nobody publishes /imu ")
            for line in warnings_of(relay, "with_optional")
        ),
        "a warning that nobody publishes it",
    )
    found = groups_of(relay)["with_optional"]["findings"]
    assert "waiting_for_optional" not in {each["code"] for each in found}


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
    counted = re.search(r'syncrelay_messages_lost_total\{group="front",topic="/camera"\} (\S+)', get(relay, "/metrics"))
    assert counted
    assert float(counted[1]) > 0


def test_a_relay_that_cannot_keep_up_is_told(stage: Stage):
    group = {**APPROXIMATE, "topics": inputs(PAIR, qos=LOSSLESS)}
    many = {"front": group, **{f"front_{number}": group for number in range(60)}}
    relay = stage.relay(config(many, metrics=ANY_PORT))
    play(stage, merged(stream("/camera", hz=600), stream("/lidar", hz=600)))
    wait_for_finding(relay, "too_slow", text=rf"messages waited up to {LASTED} for the relay")


def test_sensors_of_one_node_that_fall_silent_are_one_line_over_all_groups(stage: Stage):
    hub = ("/imu", "/gps", "/odom")
    # Whoever starts 10 s after the other still finds its partners.
    options = {**APPROXIMATE, "queue_size": 100}
    groups = {
        f"with{topic.replace('/', '_')}": {**options, "topics": inputs(dict.fromkeys(("/lidar", topic), VECTOR))}
        for topic in hub
    }
    relay = stage.relay(config(groups, metrics=ANY_PORT))
    play(stage, stream("/lidar", hz=10), node="ouster")
    stopped = play(stage, merged(*(stream(topic, hz=10) for topic in hub)), node="hub")
    wait_until(lambda: sum(each["rate_hz"] > 5 for each in status(relay)["groups"]) == len(hub), "sets of all groups")
    stopped.process.send(signal.SIGSTOP)
    relay.wait_for_log(r"no more sets for ")
    lines = [line for line in relay.stderr.splitlines() if "no more sets for " in line]
    stopped.process.send(signal.SIGCONT)
    assert len(lines) == 1
    assert re.search(
        rf"3 groups \(with_imu, with_gps and with_odom\): no more sets for {LASTED}: /imu has been silent for {LASTED};"
        r".* the same holds for /gps and /odom; check /hub, which",
        lines[0],
    ), lines
    relay.wait_for_log("3 groups (with_imu, with_gps and with_odom): recovered after ")
