"""Groups at work: shared topics, many topics, any order of starting, and a recording that begins again."""

import signal
import subprocess

import pytest

from syncrelay.sync import ApproximateTime, ExactTime
from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR, stamps_of
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs, outputs
from tests.ros.frames import Frame
from tests.ros.processes import wait_until
from tests.ros.stage import Stage, both_backends
from tests.ros.streams import MS, at, jittery, merged
from tests.ros.summary import read_summary

pytestmark = [pytest.mark.ros, both_backends]

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_PAIR_OUT = dict.fromkeys(outputs("front", _PAIR), VECTOR)


def _pair_recording() -> list[Frame]:
    return merged(
        jittery("/camera", period_ms=33, jitter_ms=5, count=120, seed=1),
        jittery("/lidar", period_ms=100, jitter_ms=5, count=40, seed=2),
    )


def _keys(topics: dict[str, str]) -> dict:
    return {"queue_size": ROOMY, "topics": inputs(topics, qos=LOSSLESS)}


def _approximate(topics: dict[str, str], *, slop_ms: int) -> dict:
    return {"policy": "approximate_time", "slop": f"{slop_ms}ms", **_keys(topics)}


def _exact(topics: dict[str, str]) -> dict:
    return {"policy": "exact_time", **_keys(topics)}


def test_a_topic_of_two_groups_is_subscribed_once_and_serves_both(stage: Stage):
    recording = merged(
        at("/camera", *range(0, 1000, 50)),
        at("/lidar", *range(0, 1000, 50)),
        at("/imu", *range(0, 1000, 10)),
    )
    groups = {
        "seeing": _exact({"/camera": VECTOR, "/lidar": VECTOR}),
        "moving": _exact({"/lidar": VECTOR, "/imu": VECTOR}),
    }
    aligned = dict.fromkeys(["/seeing/camera", "/seeing/lidar", "/moving/lidar", "/moving/imu"], VECTOR)
    _, collector = relaying.relay(stage, config(groups), recording, aligned)
    for group, topics in (("seeing", ["/camera", "/lidar"]), ("moving", ["/lidar", "/imu"])):
        expected = relaying.expected_sets(ExactTime(n_inputs=2, queue_size=ROOMY), recording, topics)
        assert len(expected) == 20
        assert relaying.sets_within(recording, collector, outputs(group, topics)) == expected
    wait_until(
        lambda: len(collector.endpoints("/lidar", kind="subscription", node="/syncrelay")) == 1, "a subscription"
    )


def test_eight_topics_leave_in_sets_of_eight(stage: Stage):
    topics = {f"/sensor_{n}": VECTOR for n in range(8)}
    recording = merged(
        *(jittery(topic, period_ms=50, jitter_ms=12, count=60, seed=seed) for seed, topic in enumerate(topics))
    )
    aligned = dict.fromkeys(outputs("all", topics), VECTOR)
    text = config({"all": _approximate(topics, slop_ms=30)})
    _, collector = relaying.relay(stage, text, recording, aligned, speed=1)
    policy = ApproximateTime(n_inputs=8, queue_size=ROOMY, slop_ns=30 * MS)
    expected = relaying.expected_sets(policy, recording, list(topics))
    assert len(expected) > 40
    assert relaying.sets_within(recording, collector, aligned) == expected


def test_a_relay_that_starts_after_its_publishers_matches_what_comes_then(stage: Stage):
    recording = _pair_recording()
    collector = stage.collector(_PAIR_OUT)
    player = stage.player(_PAIR)
    wait_until(lambda: all(collector.endpoints(t, kind="publisher") for t in _PAIR), "the publishers")
    stage.relay(config({"front": _approximate(_PAIR, slop_ms=40)}))
    relaying.connect(player, collector, recording, _PAIR_OUT)
    player.play(recording)
    relaying.conclude(player, collector, recording, _PAIR_OUT)
    policy = ApproximateTime(n_inputs=2, queue_size=ROOMY, slop_ns=40 * MS)
    expected = relaying.expected_sets(policy, recording, list(_PAIR))
    assert len(expected) > 30
    assert relaying.sets_within(recording, collector, _PAIR_OUT) == expected


def test_a_recording_that_begins_again_gives_the_same_sets_again(stage: Stage):
    recording = _pair_recording()
    collector = stage.collector(_PAIR_OUT)
    stage.relay(config({"front": _approximate(_PAIR, slop_ms=40)}))
    player = stage.player(_PAIR)
    relaying.connect(player, collector, recording, _PAIR_OUT)
    passes = []
    for _ in range(3):
        before = collector.count("/front/camera")
        # Paced: of what DDS has to send again the order between topics is another.
        player.play(recording, speed=4)
        relaying.conclude(player, collector, recording, _PAIR_OUT)
        passes.append([collector.payloads(output)[before:] for output in _PAIR_OUT])
    assert len(passes[0][0]) > 30
    assert passes == [passes[0]] * 3


def test_a_relay_that_is_held_up_makes_the_sets_of_one_that_is_not(stage: Stage):
    recording = merged(
        jittery("/camera", period_ms=4, jitter_ms=1, count=1000, seed=1),
        jittery("/lidar", period_ms=4, jitter_ms=1, count=1000, seed=2),
    )
    collector = stage.collector(_PAIR_OUT)
    relay = stage.relay(config({"front": _approximate(_PAIR, slop_ms=2)}))
    player = stage.player(_PAIR)
    relaying.connect(player, collector, recording, _PAIR_OUT)
    player.start(recording, speed=1)
    while not player.finished():
        relay.send(signal.SIGSTOP)
        # In this time come 25 messages of each topic, more than a group keeps.
        with pytest.raises(subprocess.TimeoutExpired):
            relay.wait(0.1)
        before = collector.count("/front/lidar")
        relay.send(signal.SIGCONT)
        relay.wait_until(
            lambda before=before: player.finished() or collector.count("/front/lidar") > before, "another set"
        )
    player.finish()
    relaying.conclude(player, collector, recording, _PAIR_OUT)
    policy = ApproximateTime(n_inputs=2, queue_size=ROOMY, slop_ns=2 * MS)
    expected = relaying.expected_sets(policy, recording, list(_PAIR))
    assert len(expected) > 900
    assert relaying.sets_within(recording, collector, _PAIR_OUT) == expected


def test_only_the_groups_that_are_named_run(stage: Stage):
    groups = {
        "seeing": _exact({"/camera": VECTOR, "/lidar": VECTOR}),
        "moving": _exact({"/lidar": VECTOR, "/imu": VECTOR}),
        "idle": _exact({"/camera": VECTOR, "/absent": VECTOR}),
    }
    recording = merged(at("/camera", 0, 10, 20), at("/lidar", 0, 10, 20), at("/imu", 0, 10, 20))
    aligned = dict.fromkeys(["/seeing/camera", "/moving/imu"], VECTOR)
    relay, collector = relaying.relay(
        stage, config(groups), recording, aligned, arguments=["--group", "moving", "--group", "seeing"]
    )
    assert stamps_of(collector.payloads("/moving/imu"))[-4:-1] == [frame.time for frame in at("", 0, 10, 20)]
    wait_until(lambda: collector.endpoints("/camera", kind="subscription", node="/syncrelay"), "the subscription")
    assert not collector.endpoints("/absent", kind="subscription", node="/syncrelay")
    assert not collector.endpoints("/idle/camera", kind="publisher")
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0
    assert set(read_summary(relay.stderr)) == {"seeing", "moving"}
