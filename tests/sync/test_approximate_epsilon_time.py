from functools import partial

import pytest

from syncrelay.sync import ApproximateEpsilonTime, Message
from tests.sync.support.timeline import TICK_NS, policy_cases


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
    }
)


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
