from functools import partial

import pytest

from syncrelay.sync import ApproximateEpsilonTime, Message
from tests.sync.support.drawn import policy_cases
from tests.sync.support.timeline import TICK_NS


def epsilon_time(inputs=2, queue=10, epsilon=2):
    return ApproximateEpsilonTime(n_inputs=inputs, queue_size=queue, epsilon_ns=epsilon * TICK_NS)


test_drawn = policy_cases(
    {
        "the oldest messages are a set if they lie within epsilon, itself included": (
            epsilon_time,
            """
            lidar  |a....b
            camera |..A..B
            -> A: aA
            -> B: bB
            """,
        ),
        "if not, the oldest is too far": (
            epsilon_time,
            """
            lidar  |ab...
            camera |...A.
            -> A: a too_far, bA
            """,
        ),
        "with it goes each input's oldest that is within epsilon of it": (
            partial(epsilon_time, 3, epsilon=5),
            """
            lidar  |a....b
            camera |....B.
            radar  |......r
            -> r: a too_far, B too_far
            """,
        ),
        "a queue above its size overflows": (
            partial(epsilon_time, queue=2),
            """
            lidar  |abc
            camera |..C
            -> c: a overflow
            -> C: bC
            """,
        ),
        "an older message finds its place in the queue": (
            partial(epsilon_time, epsilon=0),
            """
            lidar  |ab
            camera |A.
            arrive: b a A
            -> A: aA
            """,
        ),
        "a later message of a stamp that is queued replaces the one before": (
            epsilon_time,
            """
            lidar  |a.
            lidar  |b.
            camera |.A
            arrive: a b A
            -> b: a duplicate
            -> A: bA
            """,
        ),
    }
)


def test_the_queue_that_was_needed_is_told_when_a_partner_has_overflowed():
    policy = epsilon_time(queue=5)
    for column in range(1, 21):
        policy.add(Message(0, column * TICK_NS, None))
    policy.add(Message(1, 8 * TICK_NS, None))
    assert [policy.needed_queue(place) for place in (0, 1)] == [14, None]
    longer = epsilon_time(queue=14)
    for column in range(1, 21):
        longer.add(Message(0, column * TICK_NS, None))
    assert longer.add(Message(1, 8 * TICK_NS, None))


def test_a_message_with_others_behind_it_does_not_ask_for_a_longer_queue():
    policy = epsilon_time(3, queue=5)
    for column in range(1, 21):
        policy.add(Message(0, column * TICK_NS, None))
    for index, column in ((1, 8), (1, 9), (2, 20)):
        policy.add(Message(index, column * TICK_NS, None))
    # From 9 to 20 are twelve, and one more; 8 would take one more again, but 9 could have come in its place.
    assert policy.needed_queue(0) == 13


def test_one_message_with_none_behind_it_is_enough_to_ask_for_a_longer_queue():
    policy = epsilon_time(3, queue=5)
    for column in range(1, 21):
        policy.add(Message(0, column * TICK_NS, None))
    for index, column in ((1, 8), (1, 9), (2, 8)):
        policy.add(Message(index, column * TICK_NS, None))
    assert policy.needed_queue(0) == 14


@pytest.mark.parametrize("wrong", [{"epsilon": -1}, {"queue": 0}, {"inputs": 0}])
def test_options_out_of_range_are_refused(wrong):
    with pytest.raises(ValueError, match="must be"):
        epsilon_time(**wrong)
