"""QoS: matched to the publishers, or as the file says."""

from collections.abc import Iterator

import pytest

from tests.ros import relaying
from tests.ros.cdr_messages import NS_PER_SECOND, VECTOR
from tests.ros.configs import config, inputs, outputs
from tests.ros.frames import Frame
from tests.ros.stage import Collector, Stage, both_backends
from tests.ros.streams import BEGIN, at, merged

pytestmark = [pytest.mark.ros, both_backends]

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_PAIR_OUT = dict.fromkeys(outputs("front", _PAIR), VECTOR)
_RECORDING = merged(at("/camera", 0), at("/lidar", 0))


def _front(**topic_keys) -> str:
    return config({"front": {"policy": "exact_time", "topics": inputs(_PAIR, **topic_keys)}})


def _endless_sets() -> Iterator[list[Frame]]:
    n = 0
    while True:
        yield relaying.a_set(_RECORDING, BEGIN + n * NS_PER_SECOND)
        n += 1


def _qos(collector: Collector, topic: str, kind: str) -> list[tuple[str, str]]:
    """Reliability and durability of each of the relay's endpoints of this kind on a topic."""
    shown = collector.endpoints(topic, kind=kind, node="/syncrelay")
    return [(endpoint["reliability"], endpoint["durability"]) for endpoint in shown]


def _wait_for_qos(collector: Collector, reliability: str, durability: str = "volatile") -> None:
    """Wait until the relay subscribes and publishes so on all its topics."""
    expected = [(reliability, durability)]
    collector.process.wait_until(
        lambda: all(
            _qos(collector, topic, "subscription") == _qos(collector, output, "publisher") == expected
            for topic, output in zip(_PAIR, _PAIR_OUT, strict=True)
        ),
        f"the relay's QoS to be {reliability}, {durability}",
    )


@pytest.mark.parametrize("reliability", ["best_effort", "reliable"])
def test_auto_takes_the_reliability_of_the_publishers_and_gives_it_to_the_outputs(stage: Stage, reliability: str):
    collector = stage.collector(_PAIR_OUT, reliability=reliability)
    stage.relay(_front())
    player = stage.player(_PAIR, reliability=reliability)
    relaying.play_until_out(player, collector, _endless_sets(), _PAIR_OUT)
    _wait_for_qos(collector, reliability)


def test_auto_is_reliable_only_if_all_publishers_are(stage: Stage):
    collector = stage.collector()
    stage.relay(_front())
    stage.player(_PAIR, reliability="reliable")
    _wait_for_qos(collector, "reliable")
    stage.player(_PAIR, reliability="best_effort")
    _wait_for_qos(collector, "best_effort")


def test_auto_becomes_reliable_when_a_best_effort_publisher_is_replaced(stage: Stage):
    collector = stage.collector(_PAIR_OUT, reliability="best_effort")
    stage.relay(_front())
    first = stage.player(_PAIR, reliability="best_effort")
    relaying.play_until_out(first, collector, _endless_sets(), _PAIR_OUT)
    first.process.ask_to_end()
    first.process.wait()
    second = stage.player(_PAIR, reliability="reliable")
    _wait_for_qos(collector, "reliable")
    later = stage.collector(_PAIR_OUT)
    relaying.play_until_out(second, later, _endless_sets(), _PAIR_OUT)


def test_a_latched_message_reaches_a_relay_that_starts_later_and_a_subscriber_later_still(stage: Stage):
    player = stage.player(_PAIR, durability="transient_local")
    player.play(_RECORDING)
    stage.relay(_front())
    collector = stage.collector(_PAIR_OUT, durability="transient_local")
    for frame, output in zip(_RECORDING, _PAIR_OUT, strict=True):
        assert collector.wait_for(output, 1) == [frame.payload]
    _wait_for_qos(collector, "reliable", "transient_local")


def test_auto_is_transient_local_only_if_all_publishers_are(stage: Stage):
    collector = stage.collector()
    stage.relay(_front())
    stage.player(_PAIR, durability="transient_local")
    _wait_for_qos(collector, "reliable", "transient_local")
    stage.player(_PAIR, durability="volatile")
    _wait_for_qos(collector, "reliable", "volatile")


@pytest.mark.parametrize(
    ("qos", "reliability", "durability"),
    [
        ("sensor_data", "best_effort", "volatile"),
        ({"reliability": "best_effort"}, "best_effort", "transient_local"),
        ({"durability": "volatile"}, "reliable", "volatile"),
    ],
    ids=["a_preset", "only_reliability", "only_durability"],
)
def test_what_the_file_says_of_qos_overrides_what_the_publishers_offer(
    stage: Stage, qos, reliability: str, durability: str
):
    collector = stage.collector()
    stage.relay(_front(qos=qos))
    stage.player(_PAIR, durability="transient_local")
    _wait_for_qos(collector, reliability, durability)
