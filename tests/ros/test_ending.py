"""SIGTERM and Control-C: an orderly end at any moment, with an account of every message."""

import itertools
import random
import signal
import subprocess

import pytest

from tests.faults.extent import chosen
from tests.preloaded import FROM_SCRATCH
from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR, stamp_of
from tests.ros.configs import LOSSLESS, config, inputs
from tests.ros.manifests import MANIFEST_TYPE, read
from tests.ros.stage import Stage
from tests.ros.streams import jittery, merged
from tests.ros.summary import read_summary

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_PAIR_OUT = {"/front/camera": VECTOR, "/front/lidar": VECTOR}
_FRONT = {"policy": "exact_time", "topics": inputs(_PAIR, qos=LOSSLESS)}

# From the first moment to well after the start: imports, joining the graph, waiting.
_CHANCE = random.Random(5)
_MOMENTS_S = [0.0, *(_CHANCE.uniform(0, 2.5) for _ in range(chosen(short=2, long=12)))]
_SIGNALS = itertools.cycle([signal.SIGTERM, signal.SIGINT])


@pytest.mark.faults
@pytest.mark.parametrize(
    ("number", "moment_s"),
    [
        pytest.param(number, each, id=f"{number.name} {each:.2f}s")
        for number, each in zip(_SIGNALS, _MOMENTS_S, strict=False)
    ],
)
def test_a_signal_at_any_moment_ends_it_in_order(stage: Stage, number: signal.Signals, moment_s: float):
    text = config({"front": _FRONT, "rear": {**_FRONT, "output_prefix": "/back"}})
    relay = stage.relay(text, before=FROM_SCRATCH)
    relay.wait_until(lambda: relay.handles(signal.SIGTERM), "its handler of signals")
    with pytest.raises(subprocess.TimeoutExpired):
        relay.wait(moment_s)
    relay.send(number)
    assert relay.wait() == 0
    assert "Traceback" not in relay.stderr
    assert set(read_summary(relay.stderr)) == {"front", "rear"} or "stopped before it started" in relay.stderr


# rclpy's executor, on which services are served, between the look whether it is shut down and the wait.
_LATE_TO_WAIT = """\
import time
from rclpy import executors
counted = executors.NumberOfEntities
def late(*numbers):
    time.sleep(0.5)
    return counted(*numbers)
executors.NumberOfEntities = late
"""


def test_it_ends_where_its_executor_was_about_to_wait(stage: Stage):
    stage.before_each_relay(_LATE_TO_WAIT)
    relay = stage.relay(config({"front": _FRONT}))
    relay.wait_for_log("front: waiting for")
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0


# A wake that the middleware takes for none: the end of serving wakes nobody.
_WAKES_NOBODY = """\
from rclpy.task import Future
Future.add_done_callback = lambda *_: None
"""


def test_it_ends_where_the_executor_is_not_woken(stage: Stage):
    stage.before_each_relay(_WAKES_NOBODY)
    relay = stage.relay(config({"front": _FRONT}))
    relay.wait_for_log("front: waiting for")
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0


# rcl's last call, as Fast DDS hangs in it.
_HANGS_IN_DDS = """\
import time
from syncrelay.ros import leaving
leaving._PATIENCE_S = 0.1
leaving._take_from_rcl = lambda address: time.sleep(10_000)
"""


def test_it_ends_in_order_where_dds_hangs_as_the_node_leaves(stage: Stage):
    stage.before_each_relay(_HANGS_IN_DDS)
    relay = stage.relay(config({"front": _FRONT}))
    relay.wait_for_log("front: waiting for")
    stage.note_shared_memory()
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0
    assert set(read_summary(relay.stderr)) == {"front"}
    assert "DDS did not let this node go within 0.1 s" in relay.stderr
    assert stage.left_in_shared_memory() == set()


# `systemctl stop` sends SIGTERM to launch and to its nodes, and launch then SIGINT to them; tests/cli/test_stop.py has
# the other pairs.
def test_two_signals_of_one_request_end_it_in_order_whoever_has_the_file_read_meanwhile(stage: Stage):
    relay = stage.relay(config({"front": _FRONT}))
    relay.wait_for_log("front: waiting for")
    stage.note_shared_memory()
    assert stage.left_in_shared_memory()
    relay.send(signal.SIGTERM)
    relay.send(signal.SIGINT)
    while relay.running():
        relay.send(signal.SIGHUP)
    assert relay.wait() == 0
    assert set(read_summary(relay.stderr)) == {"front"}
    assert stage.left_in_shared_memory() == set()


# On a busy machine the collector may take longer to read what was published last than the relay waits for it.
_PATIENT = """
from syncrelay.relay import groups
groups._ACKNOWLEDGE_NS *= 200
"""


def test_it_ends_in_order_while_messages_pour_in(stage: Stage):
    stage.before_each_relay(_PATIENT)
    recording = merged(
        jittery("/camera", period_ms=5, jitter_ms=1, count=4000, seed=1),
        jittery("/lidar", period_ms=5, jitter_ms=1, count=4000, seed=2),
    )
    collector = stage.collector({**_PAIR_OUT, "/syncrelay/front/sets": MANIFEST_TYPE})
    relay = stage.relay(config({"front": _FRONT | {"policy": "approximate_time", "slop": "10ms"}}))
    player = stage.player(_PAIR)
    relaying.connect(player, collector, recording, [*_PAIR_OUT, "/syncrelay/front/sets"])
    player.start(recording, speed=1)
    collector.wait_for("/front/camera", 200)
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0
    last = read_summary(relay.stderr)["front"].sets
    begin = min(stamp_of(frame.payload) for frame in recording)

    def told() -> list[int]:
        """The numbers of the recording's sets."""
        manifests = map(read, collector.payloads("/syncrelay/front/sets"))
        return [each.number for each in manifests if each.stamp >= begin]

    collector.process.wait_until(lambda: told()[-1:] == [last], "the manifest of the summary's last set")
    numbers = told()
    assert len(numbers) > 100
    assert numbers == [*range(numbers[0], last + 1)]
    for output in _PAIR_OUT:
        collector.process.wait_until(
            lambda output=output: len(relaying.within(recording, collector.payloads(output))) == len(numbers),
            f"all {len(numbers)} sets of the summary on {output}",
        )
