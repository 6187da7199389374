"""What has piled up while the relay could not run is handed on as it came."""

import signal

import pytest

from syncrelay.sync import ApproximateTime
from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, config, inputs, outputs
from tests.ros.stage import Stage, both_backends
from tests.ros.streams import MS, jittery, merged

pytestmark = [pytest.mark.ros, both_backends]

_PAIR = {"/imu": VECTOR, "/lidar": VECTOR}
_OUT = dict.fromkeys(outputs("front", _PAIR), VECTOR)


def test_a_backlog_of_a_fast_and_a_slow_topic_is_matched_in_the_order_of_arrival(stage: Stage):
    # A queue that holds the fast topic for little more than a period of the slow one: drained topic by topic, it
    # would overflow before the slow topic's turn comes.
    # Few enough that Fast DDS's shared memory holds them all: what it has to send again comes in another order.
    recording = merged(
        jittery("/imu", period_ms=5, jitter_ms=1, count=200, seed=1),
        jittery("/lidar", period_ms=100, jitter_ms=5, count=10, seed=2),
    )
    group = {"policy": "approximate_time", "slop": "10ms", "queue_size": 30, "topics": inputs(_PAIR, qos=LOSSLESS)}
    collector = stage.collector(_OUT)
    relay = stage.relay(config({"front": group}))
    player = stage.player(_PAIR)
    relaying.connect(player, collector, recording, _OUT)
    relay.send(signal.SIGSTOP)
    player.play(recording, speed=100)
    relay.send(signal.SIGCONT)
    relaying.conclude(player, collector, recording, _OUT)
    expected = relaying.expected_sets(
        ApproximateTime(n_inputs=2, queue_size=30, slop_ns=10 * MS), recording, list(_PAIR)
    )
    assert len(expected) >= 8
    assert relaying.sets_within(recording, collector, _OUT) == expected
