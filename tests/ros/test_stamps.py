"""Where a stamp comes from, and what becomes of it."""

import itertools
import signal

import pytest

from tests.ros import relaying
from tests.ros.cdr_messages import (
    NS_PER_SECOND,
    STRING,
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
from tests.ros.configs import LOSSLESS, config, inputs, outputs
from tests.ros.frames import Frame
from tests.ros.stage import Stage, both_backends
from tests.ros.streams import BEGIN, at, merged
from tests.ros.summary import read_summary

pytestmark = [pytest.mark.ros, both_backends]

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_PAIR_OUT = dict.fromkeys(outputs("front", _PAIR), VECTOR)
_CAMERA = at("/camera", 3, 103, 203)
_LIDAR = at("/lidar", 0, 100, 200)
_RECORDING = merged(_CAMERA, _LIDAR)


def _group(**keys) -> dict:
    return {
        "policy": "approximate_time",
        "slop": "5ms",
        "topics": inputs(_PAIR, qos=LOSSLESS),
        **keys,
    }


def _relayed(stage: Stage, group: dict) -> list[tuple[bytes, ...]]:
    _, collector = relaying.relay(stage, config({"front": group}), _RECORDING, _PAIR_OUT)
    return relaying.sets_within(_RECORDING, collector, _PAIR_OUT)


def test_without_restamp_payloads_leave_as_they_came(stage: Stage):
    assert _relayed(stage, _group()) == _pairs(_CAMERA, _LIDAR)


@pytest.mark.parametrize(
    ("restamp", "source"),
    [("earliest", _LIDAR), ("latest", _CAMERA), ("/camera", _CAMERA), ("/lidar", _LIDAR)],
)
def test_restamp_gives_a_set_one_stamp_and_leaves_every_other_byte(stage: Stage, restamp: str, source: list[Frame]):
    restamped = [
        [_restamped(frame, common.time) for frame, common in zip(frames, source, strict=True)]
        for frames in (_CAMERA, _LIDAR)
    ]
    assert _relayed(stage, _group(restamp=restamp)) == _pairs(*restamped)


def test_an_offset_shifts_the_stamp_for_matching_only(stage: Stage):
    topics = inputs(_PAIR, qos=LOSSLESS)
    topics[0]["offset"] = "-3ms"
    collector = stage.collector(_PAIR_OUT)
    stage.relay(config({"front": _group(slop="0ms", topics=topics)}))

    def set_at(place: int) -> list[Frame]:
        offset_ms = 100 * place
        return at("/camera", offset_ms + 3) + at("/lidar", offset_ms)

    sets = map(set_at, itertools.count())
    sent, out = relaying.one_set(stage.player(_PAIR), collector, sets, list(_PAIR_OUT))
    assert out == [frame.payload for frame in sent]


def test_stamps_in_big_endian_payloads_are_read_and_patched_as_such(stage: Stage):
    camera = [frame._replace(payload=vector(frame.time, little_endian=False)) for frame in _CAMERA]
    recording = merged(camera, _LIDAR)
    group = _group(restamp="earliest")
    _, collector = relaying.relay(stage, config({"front": group}), recording, _PAIR_OUT)
    patched = [_restamped(frame, lidar.time) for frame, lidar in zip(camera, _LIDAR, strict=True)]
    assert relaying.sets_within(recording, collector, _PAIR_OUT) == _pairs(patched, _LIDAR)


def test_a_stamp_can_come_from_a_field(stage: Stage):
    day_ns = 24 * 3600 * NS_PER_SECOND
    types = {"/gps_time": TIME_REFERENCE, "/lidar": VECTOR}
    topics = inputs(types, qos=LOSSLESS)
    topics[0]["stamp"] = {"field": "time_ref"}
    aligned = dict(zip(outputs("front", types), types.values(), strict=True))

    def a_set(stamp: int) -> list[Frame]:
        reference = serialize(TIME_REFERENCE, header(stamp + day_ns), time(stamp), "gps")
        return [Frame("/gps_time", TIME_REFERENCE, 0, reference), Frame("/lidar", VECTOR, 0, vector(stamp))]

    collector = stage.collector(aligned)
    stage.relay(config({"front": _group(topics=topics)}))
    sets = map(a_set, itertools.count(BEGIN, NS_PER_SECOND))
    relaying.play_until_out(stage.player(types), collector, sets, aligned)

    def is_together() -> bool:
        """Whether both messages of one set have come: the first of an output may come before the other is heard."""
        references, lidars = (collector.payloads(output) for output in aligned)
        pairs = [[padded(frame.payload) for frame in a_set(stamp_of(lidar))] for lidar in lidars]
        return any(reference in references and lidar in lidars for reference, lidar in pairs)

    collector.process.wait_until(is_together, "both messages of a set")


def test_headerless_messages_go_by_the_time_they_are_received(stage: Stage):
    types = {"/left": STRING, "/right": STRING}
    topics = inputs(types, qos=LOSSLESS, stamp="receive")
    aligned = dict.fromkeys(outputs("front", types), STRING)
    sent = {topic: [padded(serialize(STRING, f"{topic} {n}")) for n in range(1000)] for topic in types}
    sets = ([Frame(topic, STRING, 0, sent[topic][n]) for topic in types] for n in range(1000))
    collector = stage.collector(aligned)
    # Wide enough for the slowest machine: that anything matches at all is what a stamp must bring.
    stage.relay(config({"front": _group(topics=topics, slop="60s")}))
    relaying.play_until_out(stage.player(types), collector, sets, aligned)
    for topic, output in zip(types, aligned, strict=True):
        assert collector.payloads(output)[0] in sent[topic]


def test_messages_without_a_readable_stamp_are_counted_and_the_relay_goes_on(stage: Stage):
    collector = stage.collector(_PAIR_OUT)
    relay = stage.relay(config({"front": _group()}))
    player = stage.player(_PAIR)
    relaying.connect(player, collector, _RECORDING, _PAIR_OUT)
    whole = vector(BEGIN)
    too_short = [whole[:1], whole[:4], whole[:8]]
    player.play([Frame("/camera", VECTOR, 0, payload) for payload in too_short])
    player.play([Frame("/lidar", VECTOR, 0, with_stamp(whole, 0))])
    player.play(_RECORDING)
    relaying.conclude(player, collector, _RECORDING, _PAIR_OUT)
    assert relaying.sets_within(_RECORDING, collector, _PAIR_OUT) == _pairs(_CAMERA, _LIDAR)
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0
    inputs_of_front = read_summary(relay.stderr)["front"].inputs
    assert inputs_of_front["/camera"].dropped["malformed"] == len(too_short)
    assert inputs_of_front["/lidar"].dropped["unstamped"] == 1


def _restamped(frame: Frame, stamp: int) -> Frame:
    return frame._replace(payload=with_stamp(frame.payload, stamp))


def _pairs(*topics: list[Frame]) -> list[tuple[bytes, ...]]:
    return list(zip(*([frame.payload for frame in frames] for frames in topics), strict=True))
