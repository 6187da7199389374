"""The order in which the backlog hands on what its sources have."""

import random

import pytest

from syncrelay.dataflow.inbox import Backlog
from tests.dataflow.payloads import Named, Source


def _source(delivered: list, *messages: tuple[int, object]) -> Source:
    """A source of payloads by their times of receipt, whose names are noted as they are delivered."""
    named = (Named(name, received) for received, name in messages)
    return Source(*named, deliver=lambda payload: delivered.append(payload.name))


def test_messages_of_all_sources_leave_by_their_time_of_receipt():
    delivered: list[str] = []
    sources = [_source(delivered, (1, "a"), (4, "b")), _source(delivered, (2, "A"), (3, "B"), (5, "C"))]
    Backlog().deliver(sources, 10)
    assert delivered == ["a", "A", "B", "b", "C"]


def test_a_clock_that_is_set_back_holds_up_no_source():
    delivered: list[str] = []
    backlog = Backlog()
    ahead, other = _source(delivered, (1000, "a"), (1001, "b")), _source(delivered, (1, "A"))
    backlog.deliver([ahead], 500)
    assert delivered == []
    for now in (1, 2):
        backlog.deliver([other], now)
    assert delivered == ["A", "a", "b"]
    assert ahead.waited == 0


def test_what_is_told_of_a_source_that_ends_is_told_no_more():
    backlog = Backlog()
    failing = _source([], (6, "a"))
    failing.deliver = {}.__getitem__
    backlog.deliver([failing], 5)
    backlog.forget(failing)
    assert not backlog.failed


def test_a_slow_topic_gets_its_turn_in_a_flood():
    delivered: list[str] = []
    imu = _source(delivered, *((2 * n, "imu") for n in range(10_000)))
    camera = _source(delivered, (99, "camera"))
    Backlog().deliver([imu, camera], 20_000)
    assert delivered.index("camera") == 50


@pytest.mark.parametrize("seed", range(10))
def test_a_source_that_ends_gives_what_is_held_of_it_and_the_others_go_on_in_order(seed):
    chance = random.Random(seed)
    delivered: list[int] = []
    times = chance.sample(range(10, 100), 30)
    sources = [_source(delivered, (at, at)) for at in times]
    backlog = Backlog()
    backlog.deliver(sources, 5)
    ending = chance.randrange(len(sources))
    backlog.forget(sources[ending])
    assert delivered == [times[ending]]
    backlog.deliver([], 100)
    assert delivered[1:] == sorted(set(times) - {times[ending]})


def test_messages_up_to_a_time_leave_however_many_they_are():
    delivered: list[str] = []
    backlog = Backlog()
    source = _source(delivered, *((100 + n, f"{n}") for n in range(1000)))
    backlog.deliver_until(900, [source])
    assert len(delivered) == 801
    backlog.deliver_held()
    assert delivered == [f"{n}" for n in range(802)]
    assert not backlog.held


@pytest.mark.parametrize("seed", range(100))
def test_each_source_tells_how_long_its_own_messages_waited_whenever_it_was_looked_at(seed):
    chance = random.Random(seed)
    backlog = Backlog()
    delivered: list[tuple[Source, int]] = []
    waits: dict[Source, int] = {}
    sources = [_source(delivered) for _ in range(chance.randint(1, 4))]
    now = 0
    for _ in range(chance.randint(1, 30)):
        looked, now = now, now + chance.randint(1, 1000)
        for source in sources:
            came = sorted(chance.randint(looked, now + 5) for _ in range(chance.choice([0, 0, 1, 3])))
            source.messages.extend(Named((source, at), at) for at in came)
        backlog.deliver([each for each in sources if each.messages or each in backlog.held], now)
        for source, at in delivered:
            waits[source] = max(waits.get(source, 0), now - at)
        delivered.clear()
    assert {each: each.waited for each in sources if each.waited} == {
        each: wait for each, wait in waits.items() if wait
    }
