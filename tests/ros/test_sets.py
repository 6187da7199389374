"""A file of many groups over DDS: whatever their keys, the sets that leave are those that the engine gives."""

import itertools
import re
import signal
import subprocess
from collections.abc import Mapping
from typing import Any, NamedTuple

import pytest

from syncrelay.config import GroupConfig, load_text
from syncrelay.sync import Match, Message
from tests.ros import relaying
from tests.ros.cdr_messages import (
    NS_PER_SECOND,
    TIME_REFERENCE,
    VECTOR,
    header,
    padded,
    serialize,
    stamp_of,
    time,
    vector,
    with_stamp,
)
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.stage import Collector, Player, Stage, both_backends
from tests.ros.streams import BEGIN, MS, jittery, merged
from tests.ros.summary import read_summary

pytestmark = pytest.mark.ros

# The sets that open and close a run are this far from it, and take none of its messages.
_APART = 1000 * NS_PER_SECOND
_CLOSING = BEGIN + _APART


class _Topic(NamedTuple):
    """How often its messages come, and how much later than they are measured their headers are stamped."""

    period_ms: float
    jitter_ms: float = 0
    shift: int = 0
    type_name: str = VECTOR

    def payload(self, measured: int) -> bytes:
        stamp = measured + self.shift
        if self.type_name == TIME_REFERENCE:
            return serialize(TIME_REFERENCE, header(stamp), time(measured), "gps")
        return vector(stamp, frame_id=f"shot {measured}", little_endian=measured % 2 == 0)

    def times(self, seed: int) -> list[Frame]:
        count = round(2000 / self.period_ms)
        return jittery("", period_ms=self.period_ms, jitter_ms=self.jitter_ms, count=count, seed=seed)


_SENSORS = {f"/sensor_{n}": _Topic(50, 12) for n in range(8)}
_TOPICS = {
    "/camera": _Topic(33, 5),
    "/lidar": _Topic(100, 5),
    "/imu": _Topic(10, 2),
    "/left": _Topic(50),
    "/right": _Topic(50, shift=5 * NS_PER_SECOND),
    "/behind": _Topic(100, shift=12 * MS),
    "/gps": _Topic(50, shift=24 * 3600 * NS_PER_SECOND, type_name=TIME_REFERENCE),
    **_SENSORS,
}


def _group(policy: str, *topics: str, of_first: Mapping[str, Any] | None = None, **keys: Any) -> dict[str, Any]:
    named = [{"topic": name, "type": _TOPICS[name].type_name, "qos": LOSSLESS} for name in topics]
    named[0] |= of_first or {}
    return {"policy": policy, "queue_size": ROOMY, **keys, "topics": named}


def _nearest(*topics: str, slop: str = "40ms", **keys: Any) -> dict[str, Any]:
    return _group("approximate_time", *topics, slop=slop, **keys)


_BY_FIELD = {"stamp": {"field": "time_ref"}}
# The sets of none of these depend on the order between topics, which DDS does not keep where it has to send again.
GROUPS = {
    "as_it_came": _nearest("/camera", "/lidar"),
    **{f"as_{of.strip('/')}": _nearest("/camera", "/lidar", restamp=of) for of in ("earliest", "latest", "/lidar")},
    "shared": _nearest("/imu", "/lidar", slop="10ms"),
    "shifted": _nearest("/behind", "/left", slop="0ms", of_first={"offset": "-12ms"}),
    "by_field": _group("exact_time", "/gps", "/left", of_first=_BY_FIELD),
    "thinned": _group("exact_time", "/gps", "/left", of_first=_BY_FIELD, max_rate="5 Hz"),
    "keyed": _group("equal_key", "/left", "/right", key="header.frame_id"),
    "eight": _nearest(*_SENSORS, slop="30ms"),
}
_TEXT = config(
    {
        **GROUPS,
        "short": _nearest("/imu", "/lidar", slop="10ms") | {"queue_size": 1},
        "unnamed": {"policy": "exact_time", "topics": inputs({"/camera": VECTOR, "/absent": VECTOR}, qos=LOSSLESS)},
    }
)
_OUTPUTS = {f"/{name}{each['topic']}": each["topic"] for name, group in GROUPS.items() for each in group["topics"]}


def _a_set(measured: int) -> list[Frame]:
    """A message of each topic."""
    return [Frame(name, topic.type_name, 0, topic.payload(measured)) for name, topic in _TOPICS.items()]


_WHOLE = vector(BEGIN)
_UNREADABLE = [_WHOLE[:1], _WHOLE[:4], _WHOLE[:8], with_stamp(_WHOLE, 0)]
# Of two seconds.
_RECORDING = merged(
    *(
        [Frame(name, topic.type_name, at.time, topic.payload(at.time)) for at in topic.times(seed)]
        for seed, (name, topic) in enumerate(_TOPICS.items())
    ),
    [Frame("/lidar", VECTOR, BEGIN + NS_PER_SECOND, payload) for payload in _UNREADABLE],
)
_PASSES = 3


def _sets_of_engine(group: GroupConfig) -> list[tuple[bytes, ...]]:
    """The sets of all passes; each has one more that closes it."""
    engine, topics = group.engine(), [topic.topic for topic in group.topics]
    sets: list[tuple[bytes, ...]] = []
    for frame in [*_a_set(BEGIN - _APART), *[*_RECORDING, *_a_set(_CLOSING)] * _PASSES]:
        if frame.topic not in topics or frame.payload in _UNREADABLE:
            continue
        stamp = stamp_of(frame.payload) - (_TOPICS["/gps"].shift if frame.topic == "/gps" else 0)
        key = frame.payload[16:40] if group.options.policy == "equal_key" else None
        for each in engine.add(Message(topics.index(frame.topic), stamp, frame.payload, key), now=0):
            if isinstance(each, Match):
                payloads = [padded(message.payload) for message in each.messages if message is not None]
                sets.append(tuple(one if each.stamp is None else with_stamp(one, each.stamp) for one in payloads))
    # The first of them opens the run.
    return sets[1:]


def _came(collector: Collector, output: str, *, since: int = BEGIN - _APART // 2) -> list[bytes]:
    begin = since + _TOPICS[_OUTPUTS[output]].shift
    return [padded(payload) for payload in collector.payloads(output) if stamp_of(payload) >= begin]


def _hold_up(relay: Process, player: Player, collector: Collector) -> None:
    """Have the relay stand still again and again while messages come."""
    while not player.finished():
        relay.send(signal.SIGSTOP)
        with pytest.raises(subprocess.TimeoutExpired):
            relay.wait(0.1)
        before = collector.count("/as_it_came/lidar")
        relay.send(signal.SIGCONT)
        relay.wait_until(
            lambda before=before: player.finished() or collector.count("/as_it_came/lidar") > before, "another set"
        )


@both_backends
def test_the_sets_that_leave_are_those_of_the_engine_and_all_is_accounted_for(stage: Stage):
    """A recording that begins again twice, at last for a relay that is held up; it started after its publishers."""
    collector = stage.collector({output: _TOPICS[topic].type_name for output, topic in _OUTPUTS.items()})
    player = stage.player(relaying.topics_of(_RECORDING))
    wait_until(lambda: all(collector.endpoints(topic, kind="publisher") for topic in _TOPICS), "the publishers")
    relay = stage.relay(_TEXT, *(word for name in (*GROUPS, "short") for word in ("--group", name)))
    relaying.play_until_out(player, collector, map(_a_set, itertools.count(BEGIN - _APART, MS)), _OUTPUTS)
    for nth in range(1, _PASSES + 1):
        # Paced: of what DDS has to send again the order between topics is another.
        player.start(_RECORDING, speed=1 if nth == _PASSES else 4)
        if nth == _PASSES:
            _hold_up(relay, player, collector)
        player.finish()
        player.play(_a_set(_CLOSING))
        collector.process.wait_until(
            lambda nth=nth: all(len(_came(collector, each, since=_CLOSING)) == nth for each in _OUTPUTS),
            "the sets that close the recording",
        )
    subscriptions = [len(collector.endpoints(topic, kind="subscription")) for topic in (*_TOPICS, "/absent")]
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0
    for group in load_text(_TEXT).groups:
        if group.name in GROUPS:
            expected = _sets_of_engine(group)
            assert len(expected) > 30
            came = (_came(collector, topic.output) for topic in group.topics)
            assert [*zip(*came, strict=True)] == expected, group.name
    # A topic is subscribed once for all groups, and a group that is not named does not run.
    assert subscriptions == [1] * len(_TOPICS) + [0]
    summary = read_summary(relay.stderr)
    assert set(summary) == {*GROUPS, "short"}
    assert summary["as_it_came"].inputs["/lidar"].dropped == {"malformed": 3 * _PASSES, "unstamped": _PASSES}
    told = [line for line in relay.stderr.splitlines() if "some left the full queue before their partners came" in line]
    assert len(told) == 1
    assert re.search(r"short:   /imu: .*overflow \d+", told[0])
