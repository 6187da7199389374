"""Bundles over a network that loses packets, by best effort: sets that are lost are lost whole, and none is wrong."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from tests.faults.extent import chosen
from tests.faults.networks import Cable, two_machines, why_not
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.frames import Frame
from tests.ros.made_messages import DEFINITIONS, PAIR, made
from tests.ros.processes import wait_until
from tests.ros.relaying import play_until_out
from tests.ros.stage import Stage
from tests.ros.streams import BEGIN, MS

pytestmark = [pytest.mark.ros, pytest.mark.faults]

_TOPICS = {"/left": VECTOR, "/right": VECTOR}
_SETS = chosen(short=500, long=10_000)
_PERIOD = 4 * MS
# More than DDS puts into one packet: every tenth set goes in pieces.
_LARGE = 70_000


@pytest.fixture
def cable() -> Iterator[Cable]:
    if reason := why_not():
        pytest.skip(reason)
    with two_machines() as made_cable:
        yield made_cable


def _payloads(number: int) -> list[bytes]:
    size = _LARGE if number % 10 == 0 else number % 9
    return [vector(BEGIN + number * _PERIOD, frame_id=side * size) for side in "lr"]


def _frames(number: int) -> list[Frame]:
    pairs = zip(_TOPICS, _payloads(number), strict=True)
    return [Frame(topic, VECTOR, number * _PERIOD, payload) for topic, payload in pairs]


@pytest.mark.timeout(600)
def test_sets_are_lost_whole_and_none_is_wrong(
    stage: Stage, cable: Cable, tmp_path_factory: pytest.TempPathFactory, figures
):
    messages = made(tmp_path_factory.getbasetemp().parent, DEFINITIONS)
    stage.environment = messages.sourced(stage.environment)
    stage.environment |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    here, there = cable.enter(cable.first), cable.enter(cable.second)
    qos = {"reliability": "best_effort", "history": "keep_last", "depth": 1000}
    group = {
        "policy": "exact_time",
        "queue_size": ROOMY,
        "outputs": False,
        "bundle": {"topic": "/set", "type": PAIR, "qos": qos},
        "topics": inputs(_TOPICS, qos=LOSSLESS),
    }
    stage.relay(config({"front": group}), before=here)
    collector = stage.collector({"/set": PAIR}, reliability="best_effort", before=there)
    player = stage.player(_TOPICS, before=here)
    numbers = iter(range(1, 1000))
    play_until_out(player, collector, (_frames(number) for number in numbers), ["/set"])
    first = next(numbers) + 1000
    cable.lose(0.1)
    player.play([frame for number in range(first, first + _SETS) for frame in _frames(number)], speed=1)
    cable.lose_no_more()
    played: set[int] = set()

    def is_over() -> bool:
        player.play(_frames(first + _SETS + len(played)))
        played.add(len(played))
        return any(_number(messages, each) >= first + _SETS for each in collector.payloads("/set"))

    wait_until(is_over, "a set after the loss")
    found = [(_number(messages, each), each) for each in collector.payloads("/set")]
    came = [(number, payload) for number, payload in found if first <= number < first + _SETS]
    for number, payload in came:
        whole = messages.decode(payload, PAIR)
        left, right = _payloads(number)
        expected = replace(whole, left=messages.decode(left, VECTOR), right=messages.decode(right, VECTOR))
        assert bytes(messages.store.serialize_cdr(expected, PAIR)) == payload, f"set {number}"
    order = [number for number, _ in came]
    assert order == sorted(set(order))
    # The large ones need all of their packets.
    assert 0.5 < len(came) / _SETS < 0.99
    figures(f"{_SETS} bundles over best effort with 10 % loss: {len(came)} came, 0 in part, 0 wrong")


def _number(messages, payload: bytes) -> int:
    stamp = messages.decode(payload, PAIR).left.header.stamp
    return int((stamp.sec * 10**9 + stamp.nanosec - BEGIN) // _PERIOD)
