"""QoS: matched to the publishers, or as the file says."""

from itertools import combinations_with_replacement, count, product
from typing import Any

import pytest

from syncrelay.config import QosOverrides, QosPreset
from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs, outputs
from tests.ros.stage import Collector, Stage, both_backends
from tests.ros.streams import BEGIN, MS, at, merged

pytest.importorskip("rclpy", reason="rclpy is not installed")

from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy

from syncrelay.ros.graph import mismatch
from syncrelay.ros.qos import input_profile, output_profile

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_PAIR_OUT = dict.fromkeys(outputs("front", _PAIR), VECTOR)
_RECORDING = merged(at("/camera", 0), at("/lidar", 0))
_TEXT = config({"front": {"policy": "exact_time", "topics": inputs(_PAIR)}})
_RELIABLE, _BEST_EFFORT = QoSReliabilityPolicy.RELIABLE, QoSReliabilityPolicy.BEST_EFFORT
_LATCHED, _VOLATILE = QoSDurabilityPolicy.TRANSIENT_LOCAL, QoSDurabilityPolicy.VOLATILE


def _offer(reliability: Any, durability: Any) -> QoSProfile:
    return QoSProfile(depth=1, reliability=reliability, durability=durability)


def test_auto_takes_the_most_that_all_publishers_offer():
    offers = [_offer(*each) for each in product((_RELIABLE, _BEST_EFFORT), (_LATCHED, _VOLATILE))]
    for number in (1, 2, 3):
        for offered in combinations_with_replacement(offers, number):
            profile = input_profile(QosOverrides(), offered)
            assert profile is not None
            assert not any(mismatch(each, profile) for each in offered)
            assert (profile.reliability == _RELIABLE) is all(each.reliability == _RELIABLE for each in offered)
            assert (profile.durability == _LATCHED) is all(each.durability == _LATCHED for each in offered)
    assert input_profile(QosOverrides(), []) is None


@pytest.mark.parametrize(
    ("asked", "reliability", "durability"),
    [
        (QosPreset("sensor_data"), _BEST_EFFORT, _VOLATILE),
        (QosOverrides(reliability="best_effort"), _BEST_EFFORT, _LATCHED),
        (QosOverrides(durability="volatile"), _RELIABLE, _VOLATILE),
    ],
    ids=["a preset", "only reliability", "only durability"],
)
def test_what_the_file_says_overrides_what_the_publishers_offer(asked, reliability, durability):
    profile = input_profile(asked, [_offer(_RELIABLE, _LATCHED)])
    assert profile is not None
    assert (profile.reliability, profile.durability) == (reliability, durability)


def test_an_output_of_an_input_that_keeps_all_keeps_the_last_5000():
    received = input_profile(QosOverrides(history="keep_all", deadline=5 * MS), [_offer(_RELIABLE, _LATCHED)])
    assert received is not None
    sent = output_profile(received)
    assert received.history == QoSHistoryPolicy.KEEP_ALL
    assert (sent.history, sent.depth) == (QoSHistoryPolicy.KEEP_LAST, 5000)
    assert mismatch(sent, received) is None


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
