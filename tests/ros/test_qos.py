"""QoS: matched to the publishers, or as the file says."""

from dataclasses import replace
from itertools import combinations_with_replacement, count

import pytest

from syncrelay.config import AUTO, QosOverrides, QosPreset
from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs, outputs
from tests.ros.stage import Collector, Stage, both_backends
from tests.ros.streams import BEGIN, MS, at, merged

pytest.importorskip("rclpy", reason="rclpy is not installed")

from syncrelay.config.profile import Profile, is_known, matched, mismatch, sent

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_PAIR_OUT = dict.fromkeys(outputs("front", _PAIR), VECTOR)
_RECORDING = merged(at("/camera", 0), at("/lidar", 0))
_TEXT = config({"front": {"policy": "exact_time", "topics": inputs(_PAIR)}})
_KINDS = [
    Profile(depth=1, reliability=reliability, durability=durability)
    for reliability in ("reliable", "best_effort")
    for durability in ("transient_local", "volatile")
]


def test_auto_takes_the_most_that_all_publishers_offer():
    for number in (1, 2, 3):
        for offered in combinations_with_replacement(_KINDS, number):
            profile = matched(AUTO, offered)
            assert not any(mismatch(each, profile) for each in offered)
            assert (profile.reliability == "reliable") is all(each.reliability == "reliable" for each in offered)
            latched = all(each.durability == "transient_local" for each in offered)
            assert (profile.durability == "transient_local") is latched
    assert not is_known(AUTO, [])


@pytest.mark.parametrize(
    ("asked", "reliability", "durability"),
    [
        (QosPreset("sensor_data"), "best_effort", "volatile"),
        (QosOverrides(reliability="best_effort"), "best_effort", "transient_local"),
        (QosOverrides(durability="volatile"), "reliable", "volatile"),
        (QosPreset("best_available"), "reliable", "transient_local"),
        (QosOverrides(reliability="best_available"), "reliable", "transient_local"),
    ],
    ids=["a preset", "only reliability", "only durability", "the best", "the best reliability"],
)
def test_what_the_file_says_overrides_what_the_publishers_offer(asked, reliability, durability):
    profile = matched(asked, _KINDS[:1])
    assert (profile.reliability, profile.durability) == (reliability, durability)


_BEST = QosPreset("best_available")


@pytest.mark.parametrize(
    ("policy", "offers", "best"),
    [
        ("reliability", ["reliable", "best_effort"], "best_effort"),
        ("durability", ["transient_local", "volatile"], "volatile"),
        ("liveliness", ["manual_by_topic", "manual_by_topic"], "manual_by_topic"),
        ("liveliness", ["manual_by_topic", "automatic"], "automatic"),
        ("liveliness", ["manual_by_topic", "unknown"], "automatic"),
        ("deadline", [5 * MS, 9 * MS], 9 * MS),
        ("deadline", [5 * MS, 0], 0),
        ("liveliness_lease_duration", [5 * MS, 9 * MS], 9 * MS),
    ],
)
def test_best_available_is_the_most_that_all_publishers_offer_and_waits_for_them(policy, offers, best):
    offered = [replace(Profile(), **{policy: offer}) for offer in offers]
    profile = matched(_BEST, offered)
    assert getattr(profile, policy) == best
    assert not any(mismatch(each, profile) for each in offered)
    assert not is_known(_BEST, [])
    assert not is_known(QosOverrides(reliability="reliable", durability="volatile", liveliness="best_available"), [])


def test_an_output_of_an_input_that_keeps_all_keeps_the_last_5000():
    received = matched(QosOverrides(history="keep_all", deadline=5 * MS), _KINDS[:1])
    output = sent(received)
    assert received.history == "keep_all"
    assert (output.history, output.depth) == ("keep_last", 5000)
    assert mismatch(output, received) is None


def _wait_for_qos(collector: Collector, *expected: str) -> None:
    """Wait until the relay subscribes and publishes with this reliability and durability on all its topics."""

    def shown(topic: str, kind: str) -> list[tuple[str, ...]]:
        endpoints = collector.endpoints(topic, kind=kind, node="/syncrelay")
        return [(each["reliability"], each["durability"]) for each in endpoints]

    collector.process.wait_until(
        lambda: all(
            shown(topic, "subscription") == shown(output, "publisher") == [expected]
            for topic, output in zip(_PAIR, _PAIR_OUT, strict=True)
        ),
        f"the relay's QoS to be {expected}",
    )


@pytest.mark.ros
@both_backends
def test_the_relay_follows_its_publishers_where_one_takes_the_place_of_another(stage: Stage):
    sets = (relaying.a_set(_RECORDING, BEGIN + n * MS) for n in count())
    collector = stage.collector(_PAIR_OUT, reliability="best_effort")
    stage.relay(_TEXT)
    first = stage.player(_PAIR, reliability="best_effort")
    relaying.play_until_out(first, collector, sets, _PAIR_OUT)
    _wait_for_qos(collector, "best_effort", "volatile")
    first.process.ask_to_end()
    first.process.wait()
    second = stage.player(_PAIR, reliability="reliable")
    _wait_for_qos(collector, "reliable", "volatile")
    relaying.play_until_out(second, stage.collector(_PAIR_OUT), sets, _PAIR_OUT)


@pytest.mark.ros
def test_a_latched_message_reaches_a_relay_that_starts_later_and_a_subscriber_later_still(stage: Stage):
    stage.player(_PAIR, durability="transient_local").play(_RECORDING)
    stage.relay(_TEXT)
    collector = stage.collector(_PAIR_OUT, durability="transient_local")
    for frame, output in zip(_RECORDING, _PAIR_OUT, strict=True):
        assert collector.wait_for(output, 1) == [frame.payload]
    _wait_for_qos(collector, "reliable", "transient_local")
