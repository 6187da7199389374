"""Sets that wait for transforms, over DDS: /tf and /tf_static as tf2's own broadcasters publish them."""

import itertools
import signal
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

import pytest

from tests.ros.cdr_messages import VECTOR, stamps_of, vector
from tests.ros.configs import LOSSLESS, config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import Process
from tests.ros.relaying import play_until_out
from tests.ros.stage import Collector, Player, Stage, both_backends
from tests.ros.streams import BEGIN, MS
from tests.ros.summary import read_summary
from tests.ros.transforms import TF, transforms

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(find_spec("tf2_msgs") is None, reason="tf2_msgs is not built here: it takes g++"),
]

_INPUTS = {"/a": VECTOR, "/b": VECTOR}
_OUTPUTS = {f"/front{topic}": VECTOR for topic in _INPUTS}
_PERIOD = 100 * MS


def _moved(stamp: int) -> Frame:
    return transforms("/tf", ("odom", "base_link", stamp))


def _pair(stamp: int, *, frame: str = "camera") -> list[Frame]:
    """A set: one message of a frame on the robot, one of the world's."""
    return [
        Frame("/a", VECTOR, 0, vector(stamp, frame_id=frame)),
        Frame("/b", VECTOR, 0, vector(stamp, frame_id="odom")),
    ]


def _group(**awaited: Any) -> dict[str, Any]:
    keys = {"target": "odom", **awaited}
    return {"policy": "exact_time", "queue_size": 100, "transforms": keys, "topics": inputs(_INPUTS, qos=LOSSLESS)}


@contextmanager
def _running(stage: Stage, **awaited: Any) -> Iterator[tuple[Process, Player, Collector]]:
    """A relay that knows the static transform and has let a first set leave."""
    relay = stage.relay(config({"front": _group(**awaited)}))
    static = stage.player({"/tf_static": TF}, node="static", durability="transient_local")
    static.match()
    static.play([transforms("/tf_static", ("base_link", "camera", 0))])
    player, collector = stage.player({**_INPUTS, "/tf": TF}), stage.collector(_OUTPUTS)
    times = itertools.count(BEGIN - 1000 * _PERIOD, _PERIOD)
    sets = ([_moved(stamp - MS), _moved(stamp + MS), *_pair(stamp)] for stamp in times)
    play_until_out(player, collector, sets, _OUTPUTS)
    yield relay, player, collector


def _end(relay: Process) -> None:
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0


def _left(collector: Collector) -> list[list[int]]:
    return [[at for at in stamps_of(collector.payloads(output)) if at >= BEGIN] for output in _OUTPUTS]


def _wait_for(collector: Collector, stamps: Iterable[int]) -> None:
    expected = [list(stamps)] * len(_OUTPUTS)
    collector.process.wait_until(lambda: _left(collector) == expected, f"sets at {expected[0]}")


@both_backends
def test_sets_leave_once_their_transforms_have_come(stage: Stage):
    stamps = [BEGIN + number * _PERIOD for number in range(5)]
    with _running(stage, wait="10s") as (relay, player, collector):
        player.play([frame for stamp in stamps for frame in _pair(stamp)])
        player.play([_moved(BEGIN - _PERIOD), _moved(stamps[2] + MS)])
        _wait_for(collector, stamps[:3])
        player.play([_moved(stamps[4])])
        _wait_for(collector, stamps)
        _end(relay)
    assert all(not each.dropped for each in read_summary(relay.stderr)["front"].inputs.values())


def test_what_cannot_be_transformed_is_dropped_after_the_wait(stage: Stage):
    with _running(stage, wait="50ms") as (relay, player, collector):
        player.play(_pair(BEGIN, frame="nowhere"))
        player.play([_moved(BEGIN + _PERIOD), _moved(BEGIN + 3 * _PERIOD)])
        player.play(_pair(BEGIN + 2 * _PERIOD))
        _wait_for(collector, [BEGIN + 2 * _PERIOD])
        _end(relay)
    assert [each.dropped for each in read_summary(relay.stderr)["front"].inputs.values()] == [{"no_transform": 1}] * 2


def test_what_waits_when_the_relay_ends_is_dropped_as_shutdown(stage: Stage):
    with _running(stage, wait="10s") as (relay, player, collector):
        player.play(_pair(BEGIN, frame="nowhere"))
        player.play([_moved(BEGIN + _PERIOD), _moved(BEGIN + 3 * _PERIOD)])
        player.play(_pair(BEGIN + 2 * _PERIOD))
        player.play(_pair(BEGIN + 2 * _PERIOD))
        _end(relay)
        assert _left(collector) == [[], []]
    dropped = [each.dropped for each in read_summary(relay.stderr)["front"].inputs.values()]
    assert all(each.get("shutdown") == 2 for each in dropped), dropped


def test_who_observes_waits_for_transforms_too_and_says_which_is_missing(stage: Stage):
    static = stage.player({"/tf_static": TF}, node="static", durability="transient_local")
    static.is_up()
    static.play([transforms("/tf_static", ("base_link", "camera", 0))])
    look = stage.observe(config({"front": _group(wait="50ms")}), "--seconds", "9")
    player = stage.player(_INPUTS)
    player.match()
    player.start(
        [frame._replace(time=n * _PERIOD) for n in range(120) for frame in _pair(BEGIN + n * _PERIOD)], speed=1
    )
    look.wait()
    assert "no transform names the target odom: " in look.stdout
    assert "exit code 1: front has 1 error" in look.stdout
