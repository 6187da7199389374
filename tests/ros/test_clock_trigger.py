"""A clock as trigger, live: by the system's clock or by /clock, the sets are those of the engine."""

import itertools
from time import time_ns

import pytest

from syncrelay.config import load_text
from syncrelay.explain.dry_run import EngineDriver
from syncrelay.sync import Match, Message
from tests.ros.cdr_messages import VECTOR, stamps_of, vector
from tests.ros.configs import LOSSLESS, config, inputs, outputs
from tests.ros.frames import Frame
from tests.ros.manifests import MANIFEST_TYPE, Told, read
from tests.ros.relaying import play_until_out
from tests.ros.stage import Collector, Stage
from tests.ros.streams import MS

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_OUT = outputs("front", _PAIR)
_MANIFEST = "/syncrelay/front/sets"
_TOLD = {**dict.fromkeys(_OUT, VECTOR), _MANIFEST: MANIFEST_TYPE}
_GROUP = {
    "policy": "latest_time",
    "trigger": "30 Hz",
    "restamp": "trigger",
    "queue_size": 100,
    "topics": inputs(_PAIR, qos=LOSSLESS),
}
_SECOND = 1000 * MS


def _frame(topic: str, stamp: int) -> Frame:
    return Frame(topic, VECTOR, 0, vector(stamp))


def _told(collector: Collector) -> list[Told]:
    return [read(payload) for payload in collector.payloads(_MANIFEST)]


def _tick(told: Told) -> int:
    assert told.common_stamp is not None
    return told.common_stamp


def _stamps(told: Told) -> tuple[int | None, ...]:
    return tuple(each.original_stamp for each in told.inputs)


def _of_engine(text: str, arrivals: list[tuple[int, int, int]]) -> dict[int, tuple[int | None, ...]]:
    """The sets by their ticks of messages given as time of receipt, input and stamp."""
    sets: dict[int, tuple[int | None, ...]] = {}

    def take(outcomes, _now):
        sets.update({each.tick: each.stamps for each in outcomes if isinstance(each, Match) and each.tick is not None})

    EngineDriver(load_text(text).groups[0], take).run(
        Message(index, stamp, received) for received, index, stamp in sorted(arrivals)
    )
    return sets


def test_live_sets_are_those_that_the_engine_gives_of_what_arrived_when_it_did(stage: Stage):
    text = config({"front": _GROUP})
    collector = stage.collector(_TOLD)
    stage.relay(text)
    player = stage.player(_PAIR)
    play_until_out(player, collector, ([_frame(topic, time_ns()) for topic in _PAIR] for _ in itertools.count()), _TOLD)
    # Of a time to come: each message waits for its ticks, however late it arrives. Each is the latest at one of them.
    begin = time_ns() + _SECOND
    end = begin + _SECOND
    stamps = [("/camera", range(begin, end, 100 * MS)), ("/lidar", range(begin, end, 40 * MS))]
    player.play([_frame(topic, stamp) for topic, each in stamps for stamp in each], speed=1e9)
    collector.process.wait_until(lambda: any(_tick(each) >= end for each in _told(collector)), "the last tick")
    told = _told(collector)
    arrivals = {
        (each.received, index, each.original_stamp)
        for one in told
        for index, each in enumerate(one.inputs)
        if each.received is not None
        if each.original_stamp is not None
    }
    assert {stamp for _, _, stamp in arrivals} >= {stamp for _, each in stamps for stamp in each}
    live = {_tick(one): _stamps(one) for one in told if begin <= _tick(one) < end}
    # One more, so that ticks go on to the end.
    expected = _of_engine(text, [*arrivals, (end, 0, end)])
    assert live == {tick: members for tick, members in expected.items() if begin <= tick < end}
    assert len(live) == 30
    sent = stamps_of(collector.payloads(_OUT[0]))
    assert [stamp for stamp in sent if begin <= stamp < end] == sorted(live)
