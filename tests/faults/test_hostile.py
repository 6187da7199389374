"""Bytes that are no message: each is counted, none brings the relay down, and right sets leave afterwards."""

from collections import Counter

import pytest

from tests.faults.extent import chosen
from tests.faults.flow import MS, accounts, wait_until_received
from tests.faults.hostile import fate, hostile_payloads
from tests.ros import relaying
from tests.ros.cdr_messages import NS_PER_SECOND, VECTOR, padded
from tests.ros.configs import LOSSLESS, config, inputs
from tests.ros.frames import Frame
from tests.ros.stage import Stage, both_backends
from tests.ros.status import ANY_PORT
from tests.ros.streams import BEGIN, at, merged

pytestmark = [pytest.mark.ros, pytest.mark.faults]

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_MESSAGES = chosen(short=500, long=10_000)


def _group(policy: str, *, of_topic: dict | None = None, **keys) -> dict:
    return {"policy": policy, "topics": inputs(_PAIR, qos=LOSSLESS, **(of_topic or {})), **keys}


# Every way by which something is read from a message, or written into it.
_GROUPS = {
    "front": _group("approximate_time", slop="5ms"),
    "restamped": _group("approximate_time_eager", slop="5ms", restamp="latest"),
    "by_field": _group("latest_time", trigger="/camera", of_topic={"stamp": {"field": "header.stamp"}}),
    "by_receipt": _group("approximate_time_eager", slop="60s", restamp="earliest", of_topic={"stamp": "receive"}),
    "by_text": _group("equal_key", key="header.frame_id", max_wait="1s"),
    "by_number": _group("equal_key", key="vector.x", restamp="earliest", of_topic={"stamp": "receive"}),
}


@both_backends
@pytest.mark.timeout(chosen(short=600, long=1200))
def test_messages_that_are_none_are_counted_and_right_sets_leave_afterwards(stage: Stage, backend: str, figures):
    aligned = {f"/{group}{topic}": VECTOR for group in _GROUPS for topic in _PAIR}
    recording = merged(at("/camera", *range(0, 1000, 20)), at("/lidar", *range(2, 1000, 20)))
    hostile = [
        Frame(topic, VECTOR, BEGIN + n * MS, payload)
        for seed, topic in enumerate(_PAIR)
        for n, payload in enumerate(hostile_payloads(_MESSAGES // 2, seed=seed))
    ]
    relay = stage.relay(config(_GROUPS, metrics=ANY_PORT))
    collector, player = stage.collector(aligned), stage.player(_PAIR)
    first = relaying.connect(player, collector, recording, [f"/front{topic}" for topic in _PAIR])
    player.play(sorted(hostile, key=lambda frame: frame.time), speed=1)
    wait_until_received(relay, [first + _MESSAGES // 2] * 2)
    # After these, nothing of what was hostile waits or is awaited any more.
    for seconds in range(5, 0, -1):
        player.play(relaying.a_set(recording, BEGIN - seconds * NS_PER_SECOND))
    player.play(recording)
    relaying.conclude(player, collector, recording, [f"/front{topic}" for topic in _PAIR])

    expected = [(one.payload, other.payload) for one, other in zip(*_by_topic(recording), strict=True)]
    assert relaying.sets_within(recording, collector, [f"/front{topic}" for topic in _PAIR]) == expected
    sent = {_without_stamp(frame.payload) for frame in [*hostile, *recording, *relaying.a_set(recording, BEGIN)]}
    for output in aligned:
        assert {_without_stamp(payload) for payload in collector.payloads(output)} <= sent
    counted = first + _MESSAGES // 2 + 5 + len(recording) // 2 + 1
    for group in _GROUPS:
        wait_until_received(relay, [counted] * 2, group)
    fates = [Counter(fate(frame.payload) for frame in frames) for frames in _by_topic(hostile)]
    for front, expected_fates in zip(accounts(relay, "front"), fates, strict=True):
        assert front["dropped"]["malformed"] == expected_fates["malformed"]
        assert front["dropped"]["unstamped"] == expected_fates["unstamped"]
    assert relay.running()
    total = fates[0] + fates[1]
    figures(
        f"{_MESSAGES} hostile messages to {len(_GROUPS)} groups ({backend}): {total['malformed']} counted as"
        f" malformed, {total['unstamped']} as unstamped, the rest have a stamp; then all {len(expected)} right sets"
    )


def _by_topic(frames: list[Frame]) -> list[list[Frame]]:
    return [[frame for frame in frames if frame.topic == topic] for topic in _PAIR]


def _without_stamp(payload: bytes) -> tuple[bytes, bytes]:
    carried = padded(payload)
    return carried[:4], carried[12:]
