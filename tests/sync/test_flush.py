"""A flush, of every policy: all that is buffered leaves, and nothing of it is known afterwards."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syncrelay.sync import Drop, DropReason, Message
from tests.faults.extent import chosen
from tests.sync.support.rigs import POLICIES, TICK, Options, make_policy, options, steps

every_policy = pytest.mark.parametrize("name", POLICIES)


def message(index, tick):
    return Message(index, tick * TICK, (index, tick), key=tick)


def needed_queues(policy):
    return [policy.needed_queue(place) or 0 for place in range(policy.n_inputs)]


@every_policy
def test_what_is_buffered_leaves_input_by_input_oldest_first(name):
    policy = make_policy(name, Options(required=(True, True, True), queue_size=9))
    buffered = [message(0, 6), message(0, 7), message(1, 4), message(1, 5)]
    for each in (buffered[3], buffered[1], buffered[0], buffered[2]):
        assert not policy.add(each)
    assert policy.flush(DropReason.SHUTDOWN) == [Drop(each, DropReason.SHUTDOWN) for each in buffered]
    assert [policy.buffered(place) for place in range(3)] == [0, 0, 0]
    assert policy.flush(DropReason.SHUTDOWN) == []


@every_policy
def test_what_overflowed_before_it_is_not_missed_after_it(name):
    policy = make_policy(name, Options(required=(True, True), queue_size=5, slop=0))
    for tick in range(1, 21):
        policy.add(message(1, tick))
    policy.flush(DropReason.TIME_JUMP)
    for tick in range(16, 21):
        policy.add(message(1, tick))
    policy.add(message(0, 15))
    assert needed_queues(policy) == [0, 0]


@every_policy
@settings(max_examples=chosen(short=8, long=400))
@given(data=st.data(), chosen=options(optional=False, limited=False, thinned=False))
def test_the_policy_is_as_new_but_for_the_queues_that_were_needed(name, data, chosen):
    before, after = (
        [step.message for step in data.draw(steps(chosen.n_inputs)) if step.message is not None] for _ in range(2)
    )
    policy, new = make_policy(name, chosen), make_policy(name, chosen)
    for each in before:
        policy.add(each)
    policy.flush(DropReason.TIME_JUMP)
    needed = needed_queues(policy)
    for each in after:
        assert list(policy.add(each)) == list(new.add(each))
        assert policy.waits_started - policy.waits_ended == new.waits_started - new.waits_ended
    assert needed_queues(policy) == list(map(max, needed, needed_queues(new)))
