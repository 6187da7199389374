"""How long a queue should have been: what was lost by overflow, and missed by another input, as columns of stamps."""

from functools import partial

import pytest

from syncrelay.sync import (
    ApproximateEpsilonTime,
    ApproximateTime,
    ApproximateTimeEager,
    EqualKey,
    ExactTime,
    LatestTime,
    Message,
)
from syncrelay.sync.queues import Losses
from tests.sync.support.timeline import TICK_NS

epsilon = partial(ApproximateEpsilonTime, queue_size=5, epsilon_ns=2 * TICK_NS)
approximate = partial(ApproximateTime, queue_size=5, slop_ns=TICK_NS)
eager = partial(ApproximateTimeEager, queue_size=5, slop_ns=2 * TICK_NS)


def latest(n_inputs, queue_size, age):
    return LatestTime(n_inputs=n_inputs, queue_size=queue_size, trigger=0, max_ages_ns=[age * TICK_NS] * n_inputs)


FAST = [(0, column) for column in range(1, 21)]
CASES = {
    # From 9 to 20 are twelve, and one more; 8 would take one more again, but 9 could have come in its place.
    "epsilon: with others behind it": (epsilon(n_inputs=3), [*FAST, (1, 8), (1, 9), (2, 20)], 13),
    "epsilon: with none behind it on one input": (epsilon(n_inputs=3), [*FAST, (1, 8), (1, 9), (2, 8)], 14),
    "approximate: with others behind it": (approximate(n_inputs=3), [*FAST, (1, 8), (1, 9), (2, 20)], 13),
    "approximate: too far from what is queued": (approximate(n_inputs=2), [*FAST[9:14], (1, 8)], None),
    "approximate: an input does not miss its own": (
        approximate(n_inputs=2, queue_size=1),
        [(1, 7), (1, 8), (0, 20)],
        None,
    ),
    "eager: with a partner": (eager(n_inputs=2), [*FAST, (1, 14)], None),
    "eager: with others behind it": (eager(n_inputs=3), [*FAST, (1, 19), (1, 8)], None),
    "exact: the input that overflowed itself": (
        ExactTime(n_inputs=2, queue_size=2),
        [(0, 10), (0, 20), (0, 30), (0, 5)],
        None,
    ),
    "exact: a stamp that comes between": (
        ExactTime(n_inputs=2, queue_size=2),
        [(0, 10), (0, 20), (0, 30), (1, 11)],
        None,
    ),
    "latest: an older one than those lost is there": (latest(3, 2, 3), [(1, 5), (1, 6), (1, 7), (2, 9), (0, 8)], None),
    "latest: one of its stamp is there": (latest(3, 2, 3), [(1, 6), (1, 7), (1, 8), (1, 9), (2, 9), (0, 8)], None),
    "latest: only what was too old was lost": (
        latest(2, 5, 1),
        [*((1, column) for column in (1, 2, 3, 11, 12, 13, 14, 15)), (0, 8)],
        None,
    ),
    "by key: the greatest of three": (EqualKey(n_inputs=2, queue_size=1), [*FAST[:6], (1, 5), (1, 2), (1, 4)], 5),
    "by key: a key that its own input lost": (EqualKey(n_inputs=2, queue_size=1), [(0, 1), (0, 2), (0, 1)], None),
    "by key: lost before ten queues": (EqualKey(n_inputs=2, queue_size=1), [*FAST, (1, 9)], None),
    "by key: lost within ten queues": (EqualKey(n_inputs=2, queue_size=1), [*FAST, (1, 10)], 11),
}


@pytest.mark.parametrize(("policy", "fed", "needed"), CASES.values(), ids=CASES)
def test_the_queue_that_was_needed_is_told(policy, fed, needed):
    for index, column in fed:
        policy.add(Message(index, column * TICK_NS, None, key=column))
    lengths = [policy.needed_queue(place) for place in range(policy.n_inputs)]
    assert lengths == ([None] * policy.n_inputs if needed is None else [needed, *[None] * (policy.n_inputs - 1)])


def test_what_was_lost_a_nanosecond_after_a_trigger_was_not_missed():
    policy = latest(2, 2, 3)
    for index, stamp in ((1, 11), (1, 20), (1, 30), (0, 10)):
        policy.add(Message(index, stamp, None))
    assert policy.needed_queue(1) is None


@pytest.mark.parametrize(
    ("lost", "wanted", "reach", "needed"),
    [
        # The queue holds 20, 30, 40: with 10 lost, one every 10.
        ([10], 10, 0, 5),
        ([10], 15, 0, None),  # nothing as new as 15 was lost
        ([10], 15, 5, 5),  # what was lost lies just within reach
        ([10], 16, 5, None),
        ([15], 10, 5, 5),
        ([15], 10, 4, None),  # lost, but as far from what is wanted as what is queued
        ([20], 10, 0, None),  # lost, but not from before what is queued
        ([], 10, 0, None),
        ([5, 10, 15, 12], 9, 1, 7),  # in whatever order they were lost
    ],
)
def test_what_was_lost_and_wanted_tells_the_length_also_after_what_was_lost_is_forgotten(lost, wanted, reach, needed):
    losses = Losses(2)
    for stamp in lost:
        losses.lose(1, stamp)
    for _ in range(2):
        losses.miss(1, [20, 30, 40], wanted, before=reach, after=reach)
        assert losses.needed == [None, needed]
        losses.forget()
        losses.miss(1, [20, 30, 40, 50, 60], wanted, before=reach, after=reach)


def test_the_greatest_length_is_kept_but_none_that_no_queue_should_have():
    losses = Losses(2)
    for place, length in ((0, 7), (1, 1001), (0, 9), (1, 1000), (0, 8), (0, 5000)):
        losses.need(place, length)
    assert losses.needed == [9, 1000]
