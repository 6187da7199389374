"""Sets that wait for transforms: what holds of every policy, and what becomes of sets that wait too long."""

import gc
import random
import weakref
from collections.abc import Sequence
from typing import Any

import pytest

from syncrelay.frames import Edge, Frames
from syncrelay.sync import (
    ApproximateTimeEager,
    Drop,
    DropReason,
    ExactTime,
    Lack,
    Lapse,
    LatestTime,
    Match,
    Message,
    Missing,
    SyncGroup,
    Transforms,
)

MS = 1_000_000
START = 10**12


def policy(name, n_inputs):
    if name == "latest_time":
        return LatestTime(n_inputs=n_inputs, queue_size=5, trigger=0)
    if name == "exact_time":
        return ExactTime(n_inputs=n_inputs, queue_size=5)
    return ApproximateTimeEager(n_inputs=n_inputs, queue_size=5, slop_ns=30 * MS)


def group(frames, *, name="exact_time", n_inputs=2, wait=100 * MS, **options):
    transforms = Transforms(frames, "base", wait)
    return SyncGroup(policy(name, n_inputs), transforms=transforms, **options)


def moving(stamp, child="cam"):
    return Edge("base", child, stamp, is_static=False)


def known_at(*stamps):
    frames = Frames()
    for stamp in stamps:
        frames.add(moving(stamp))
    return frames


def add(engine, stamp, *, frames=("cam", None), now=None):
    left = []
    for index, frame in enumerate(frames):
        left += engine.add(Message(index, stamp, None, frame=frame), now=stamp if now is None else now)
    return left


def stamps(outcomes: Sequence[Any]) -> list[int]:
    firsts = [each.messages[0] if isinstance(each, Match) else each.message for each in outcomes]
    return [each.stamp - START for each in firsts if each is not None]


def test_a_set_waits_until_its_transform_is_there():
    frames = known_at(START - 10 * MS, START)
    engine = group(frames)
    assert add(engine, START + MS) == []
    assert [each.buffered for each in engine.counts()] == [1, 1]
    assert engine.next_deadline() == START + 101 * MS
    frames.add(moving(START + 5 * MS))
    (left,) = engine.expire(now=START + 8 * MS)
    assert isinstance(left, Match)
    assert engine.sets == 1
    assert engine.next_deadline() is None


def test_a_set_that_waited_too_long_is_dropped_and_says_what_it_lacked_and_how_long_it_had_to_wait():
    frames = known_at(START - 10 * MS, START)
    engine = group(frames)
    add(engine, START + MS)
    assert {each.reason for each in engine.expire(now=START + 101 * MS)} == {DropReason.NO_TRANSFORM}
    late = Lapse(0, Missing(Lack.LATE, "base", "cam", MS))
    assert [*engine.lapses] == [late]
    frames.add(moving(START + 5 * MS))
    assert engine.expire(now=START + 181 * MS) == []
    assert [*engine.lapses] == [late, Lapse(0, late.missing, needed_ns=180 * MS, covered=START + 181 * MS)]


def test_of_a_set_that_lacks_something_else_later_that_is_said_too():
    frames = Frames()
    engine = group(frames)
    add(engine, START)
    engine.expire(now=START + 100 * MS)
    frames.add(moving(START + 5 * MS))
    engine.expire(now=START + 181 * MS)
    assert [each.missing.lack for each in engine.lapses] == [Lack.UNKNOWN_FRAME, Lack.PAST]


def test_after_a_flush_no_set_that_was_given_up_is_followed():
    frames = known_at(START - 10 * MS, START)
    engine = group(frames)
    add(engine, START + MS)
    engine.expire(now=START + 101 * MS)
    engine.flush(DropReason.TIME_JUMP)
    frames.add(moving(START + 5 * MS))
    engine.expire(now=START + 181 * MS)
    assert [each.needed_ns for each in engine.lapses] == [None]


def test_a_message_without_a_frame_is_given_up_at_once():
    engine = group(known_at(START - MS, START + 50 * MS))
    assert [each.reason for each in add(engine, START, frames=("", None))] == [DropReason.NO_TRANSFORM] * 2
    assert engine.lapses[0].missing.lack is Lack.NO_FRAME


def test_a_set_that_is_ready_waits_for_the_one_before_it():
    engine = group(known_at(START - MS, START + 50 * MS))
    assert add(engine, START, frames=("arm", None)) == []
    assert add(engine, START + MS) == []
    left = engine.expire(now=START + 100 * MS)
    assert [type(each) for each in left] == [Drop, Drop, Match]


def test_a_set_that_no_later_transform_can_help_does_not_hold_up_the_next():
    frames = Frames()
    engine = group(frames)
    assert add(engine, START) == []
    frames.add(moving(START + MS))
    frames.add(moving(START + 9 * MS))
    assert stamps(add(engine, START + 5 * MS)) == [0, 0, 5 * MS]


def test_no_more_sets_wait_than_the_queue_is_long():
    engine = group(Frames(), most_waiting=3)
    left = [each for number in range(5) for each in add(engine, START + number * MS, now=START)]
    assert stamps(left) == [0, 0, MS, MS]


def test_what_counts_is_the_stamp_with_which_a_message_leaves():
    frames = known_at(START - MS, START + 10 * MS)
    transforms = Transforms(frames, "base", 0)
    engine = SyncGroup(policy("approximate_time_eager", 2), transforms=transforms, restamp=1)
    engine.add(Message(0, START + 12 * MS, None, frame="cam"), now=START)
    assert len(engine.add(Message(1, START + 8 * MS, None), now=START)) == 1
    assert engine.sets == 1


@pytest.mark.parametrize("name", ["exact_time", "approximate_time_eager", "latest_time"])
@pytest.mark.parametrize("seed", range(12))
def test_every_message_is_matched_dropped_or_buffered_and_sets_leave_in_order(name, seed):
    rng = random.Random(f"{name} {seed}")
    frames = Frames()
    engine = group(
        frames,
        name=name,
        n_inputs=3,
        wait=rng.choice((0, 20 * MS, 200 * MS)),
        most_waiting=rng.choice((1, 3, 50)),
        every=rng.choice((1, 1, 2)),
        max_wait_ns=rng.choice((None, 10 * MS)),
    )
    fed = [0] * 3
    matched: list[set[Any]] = [set() for _ in fed]
    dropped: list[set[Any]] = [set() for _ in fed]
    before = 0
    numbers = iter(range(10**6))
    for step in range(600):
        now = START + step * 5 * MS
        chance = rng.random()
        left = []
        if chance < 0.3:
            frames.add(moving(now - rng.choice((0, 30, 300)) * MS, rng.choice(("cam", "arm"))))
            left += engine.expire(now=now)
        elif chance < 0.32:
            left += rng.choice((engine.flush, engine.let_go))(DropReason.PAUSED)
        else:
            index = rng.randrange(3)
            fed[index] += 1
            stamp = now // (20 * MS) * 20 * MS
            left += engine.add(Message(index, stamp, None, next(numbers), ("cam", "arm", None)[index]), now=now)
        for outcome in left:
            if isinstance(outcome, Match):
                messages = [message for message in outcome.messages if message is not None]
                for message in messages:
                    matched[message.input].add(message.key)
                assert messages[0].stamp >= before
                before = messages[0].stamp
            else:
                seen = dropped[outcome.message.input]
                assert outcome.message.key not in seen
                seen.add(outcome.message.key)
        for index, counts in enumerate(engine.counts()):
            assert counts.fed == fed[index] == counts.matched + sum(counts.dropped.values()) + counts.buffered
            assert counts.matched == len(matched[index])
            assert sum(counts.dropped.values()) == len(dropped[index])
            assert not matched[index] & dropped[index]
    engine.flush(DropReason.SHUTDOWN)
    assert [each.buffered for each in engine.counts()] == [0, 0, 0]


def test_sets_that_were_given_up_are_followed_without_their_messages():
    class Payload:
        pass

    payload = Payload()
    gone = weakref.ref(payload)
    engine = group(Frames(), wait=0)
    engine.add(Message(0, START, payload, frame="cam"), now=START)
    left = engine.add(Message(1, START, None), now=START)
    assert [each.reason for each in left if isinstance(each, Drop)] == [DropReason.NO_TRANSFORM] * 2
    del left, payload
    gc.collect()
    assert gone() is None
