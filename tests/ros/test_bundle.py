"""Sets as one message each, over DDS, of a type that is only known from a package that was built here."""

import re
from itertools import count
from typing import Any

import pytest

from tests.ros.cdr_messages import VECTOR, stamp_of, vector
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.frames import Frame
from tests.ros.made_messages import DEFINITIONS, HOLDER, OWN, OWN_TEXT, PAIR, MadeMessages, made
from tests.ros.manifests import MANIFEST_TYPE, Told, read
from tests.ros.processes import wait_until
from tests.ros.relaying import play_until_out
from tests.ros.stage import Collector, Stage, both_backends
from tests.ros.status import ANY_PORT, groups_of, wait_for_finding
from tests.ros.streams import BEGIN, MS

pytestmark = pytest.mark.ros

_TOPICS = {"/rig/left": VECTOR, "/rig/right": VECTOR}
_BUNDLE = {"topic": "/front/set", "type": PAIR}
_PERIOD = 100 * MS
_MANIFEST = "/syncrelay/front/sets"


@pytest.fixture(scope="session")
def pair(tmp_path_factory: pytest.TempPathFactory) -> MadeMessages:
    return made(tmp_path_factory.getbasetemp().parent, DEFINITIONS)


@pytest.fixture
def sourced(stage: Stage, pair: MadeMessages) -> Stage:
    """A stage on which every process has the package sourced."""
    stage.environment = pair.sourced(stage.environment)
    return stage


def _group(**keys: Any) -> dict[str, Any]:
    left, right = _TOPICS
    topics = [
        *inputs({left: VECTOR}, qos=LOSSLESS),
        *inputs({right: VECTOR}, qos=LOSSLESS, required=False),
    ]
    base = {"policy": "approximate_time", "slop": "20ms", "max_wait": "10min", "queue_size": ROOMY, "bundle": _BUNDLE}
    return {**base, "topics": topics, **keys}


def _is_missing(number: int) -> bool:
    return number % 3 == 1


def _frames(number: int) -> list[Frame]:
    """A set by its number; a third has no message of the right."""
    began = BEGIN + number * _PERIOD
    left = Frame("/rig/left", VECTOR, 0, vector(began, frame_id="l" * (number % 7)))
    right = Frame("/rig/right", VECTOR, 0, vector(began + 3 * MS, frame_id="r" * (number % 5), little_endian=False))
    return [left] if _is_missing(number) else [left, right]


def _connected(stage: Stage, collector: Collector, *topics: str) -> tuple[Any, int]:
    """The player, and the number of the next set to play, once a set has come out."""
    player, numbers = stage.player(_TOPICS), count(0, 3)
    play_until_out(player, collector, (_frames(number) for number in numbers), topics)
    return player, next(numbers)


def _require_whole(pair: MadeMessages, payload: bytes, *, restamped: bool = False) -> int:
    """Check all of a bundle; its number among those that were played."""
    found = pair.decode(payload, PAIR)
    stamp = found.left.header.stamp
    played = (stamp.sec * 10**9 + stamp.nanosec - BEGIN - (3 * MS if restamped else 0)) // _PERIOD
    sent = {frame.topic: frame.payload for frame in _frames(played)}
    left = pair.decode(sent["/rig/left"], VECTOR)
    right = pair.decode(sent.get("/rig/right", vector(0, frame_id="")), VECTOR)
    latest = max(map(stamp_of, sent.values()))
    assert (found.left.header.frame_id, found.left.vector) == (left.header.frame_id, left.vector)
    if _is_missing(played):
        zero = pair.store.types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
        assert (found.missing, found.right.header.frame_id, found.right.vector) == (["right"], "", zero)
    else:
        assert (found.missing, found.right.header.frame_id) == ([], right.header.frame_id)
        assert found.right.vector == right.vector
    stamps = [each.sec * 10**9 + each.nanosec for each in found.stamps]
    assert stamps == [stamp_of(sent[topic]) if topic in sent else 0 for topic in _TOPICS]
    assert found.header.stamp.sec * 10**9 + found.header.stamp.nanosec == latest
    assert (found.flag, found.between, found.rotation.w, found.header.frame_id) == (True, 7, 1.0, "")
    return played


@both_backends
def test_each_set_leaves_as_one_message_with_all_that_is_said_of_it(sourced: Stage, pair: MadeMessages):
    sourced.relay(config({"front": _group(outputs=False)}))
    collector = sourced.collector({"/front/set": PAIR, _MANIFEST: MANIFEST_TYPE})
    player, first = _connected(sourced, collector, "/front/set", _MANIFEST)
    before = collector.count("/front/set")
    frames = [frame for number in range(first, first + 301) for frame in _frames(number)]
    player.play(frames, speed=1e9)
    payloads = collector.wait_for("/front/set", before + 300)
    played = [_require_whole(pair, payload) for payload in payloads]
    assert played[before : before + 300] == list(range(first, first + 300))
    numbers = [pair.decode(payload, PAIR).number for payload in payloads]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert collector.endpoints("/front/rig/left", kind="publisher") == []
    collector.process.wait_until(lambda: _last_told(collector).number >= numbers[-1], "the last manifest")
    told = _last_told(collector)
    assert {each.output for each in told.inputs} == {"/front/set"}
    assert {each.sequence for each in told.inputs if each.sequence is not None} == {told.number}


def _last_told(collector: Collector) -> Told:
    return read(collector.payloads(_MANIFEST)[-1])


@both_backends
def test_a_common_stamp_is_in_the_members_too_and_outputs_are_left_as_they_were(sourced: Stage, pair: MadeMessages):
    relay = sourced.relay(config({"front": _group(restamp="latest")}, metrics=ANY_PORT))
    topics = {"/front/set": PAIR, "/front/rig/left": VECTOR}
    collector = sourced.collector({**topics, _MANIFEST: MANIFEST_TYPE})
    player, first = _connected(sourced, collector, *topics, _MANIFEST)
    before = [collector.count(topic) for topic in topics]
    player.play([frame for number in range(first, first + 31) for frame in _frames(number)], speed=1e9)
    bundles, lefts = (
        collector.wait_for(topic, had + 30)[had : had + 30] for topic, had in zip(topics, before, strict=True)
    )
    last = pair.decode(collector.payloads("/front/set")[-1], PAIR).number
    collector.process.wait_until(lambda: _last_told(collector).number >= last, "the last manifest")
    told = _last_told(collector)
    # The first sets may have left before the bundle's publisher was there.
    assert {read(each).bundle for each in collector.payloads(_MANIFEST)} == {"/front/set"}
    sequences = [int(read(each).bundle_sequence or 0) for each in collector.payloads(_MANIFEST)[-30:]]
    assert sequences == list(range(sequences[0], sequences[0] + 30))
    assert sequences[-1] <= told.number
    assert {each.output for each in told.inputs} == {"/front/rig/left", "/front/rig/right"}
    wait_until(lambda: "front" in groups_of(relay), "the status of the group")
    assert groups_of(relay)["front"]["bundle"] == "/front/set"
    relay.wait_for_log("/rig/right -> /front/rig/right, whole sets -> /front/set")
    for number, bundle, left in zip(range(first, first + 30), bundles, lefts, strict=True):
        latest = max(stamp_of(frame.payload) for frame in _frames(number))
        found = pair.decode(bundle, PAIR)
        stamps = [found.header.stamp, found.left.header.stamp]
        stamps += [] if _is_missing(number) else [found.right.header.stamp]
        assert {stamp.sec * 10**9 + stamp.nanosec for stamp in stamps} == {latest}
        assert stamp_of(left) == latest
        assert pair.store.serialize_cdr(found.left, VECTOR) == pair.store.serialize_cdr(
            pair.store.deserialize_cdr(left, VECTOR), VECTOR
        )


def test_messages_of_another_definition_than_the_bundles_are_refused_with_both(
    stage: Stage, pair: MadeMessages, tmp_path_factory: pytest.TempPathFactory
):
    theirs = made(tmp_path_factory.getbasetemp().parent, {OWN: f"{OWN_TEXT}uint8 more\n"})
    plain = stage.environment
    stage.environment = theirs.sourced(plain)
    player = stage.player({"/own": OWN, "/rig/left": VECTOR}, node="camera")
    stage.environment = pair.sourced(plain)
    group = {
        "policy": "approximate_time",
        "slop": "20ms",
        "bundle": {"topic": "/set", "type": HOLDER},
        "topics": inputs({"/own": OWN, "/rig/left": VECTOR}),
    }
    relay = stage.relay(config({"front": group}, metrics=ANY_PORT))
    player.is_up()
    found = wait_for_finding(relay, "no_bundle", naming=["/camera publishes /own", HOLDER, ", here RIHS01_"])
    assert len(set(re.findall(r"RIHS01_[0-9a-f]{64}", found["text"]))) == 2
