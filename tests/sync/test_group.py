"""What a group counts and refuses; test_reference_group.py has what it does."""

from typing import Any, assert_type

import pytest

from syncrelay.sync import (
    ApproximateTime,
    Drop,
    DropReason,
    ExactTime,
    InputCounts,
    LatestTime,
    Match,
    Message,
    Restamp,
    SyncGroup,
)
from tests.sync.support.timeline import START_NS, TICK_NS, stamp


def grouped(policy, *, optional=(), max_wait=None, period=None, **options):
    return SyncGroup(
        policy,
        required=[index not in optional for index in range(policy.n_inputs)],
        max_wait_ns=None if max_wait is None else max_wait * TICK_NS,
        min_set_period_ns=None if period is None else period * TICK_NS,
        **options,
    )


def exact(**options):
    return grouped(ExactTime(n_inputs=2, queue_size=10), **options)


def approximate(inputs=2, **options):
    return grouped(ApproximateTime(n_inputs=inputs, queue_size=5, slop_ns=TICK_NS), **options)


def test_counts_say_where_every_message_went():
    group = exact()
    for index, time in ((0, 1), (0, 2), (1, 2), (0, 3), (0, 1)):
        group.add(Message(index, time, None), now=0)
    drop = group.reject(Message(1, 0, None), DropReason.MALFORMED)
    assert drop == Drop(Message(1, 0, None), DropReason.MALFORMED)
    superseded_and_late = {DropReason.SUPERSEDED: 1, DropReason.LATE: 1}
    assert group.counts() == (
        InputCounts(fed=4, matched=1, dropped=superseded_and_late, buffered=1, needed_queue=None),
        InputCounts(fed=2, matched=1, dropped={DropReason.MALFORMED: 1}, buffered=0, needed_queue=None),
    )
    assert group.sets == 1


@pytest.mark.parametrize("options", [{}, {"max_wait": 5}, {"inputs": 3, "optional": (0,), "max_wait": 5}])
def test_counts_tell_the_queue_that_was_needed(options):
    group = approximate(**options)
    for column in range(20):
        group.add(Message(1, stamp(column), None), now=0)
    other = 2 if "inputs" in options else 0
    group.add(Message(other, stamp(7), None), now=0)
    assert [index for index, counts in enumerate(group.counts()) if counts.needed_queue == 14] == [1]


def test_what_passed_before_a_flush_is_counted_again_after_it():
    policy = LatestTime(n_inputs=2, queue_size=9, trigger=0, max_ages_ns=[None] * 2)
    group = grouped(policy, period=1)
    for _ in range(2):
        group.add(Message(1, stamp(0), "A"), now=0)
        (match,) = group.add(Message(0, stamp(1), "a"), now=0)
        assert len(match.messages) == 2
        group.flush(DropReason.TIME_JUMP)
    assert [counts.matched for counts in group.counts()] == [2, 2]


def test_stamps_below_zero_match_and_are_late_but_never_jump():
    group = exact()
    for time in (-9 * START_NS, -3 * START_NS):
        group.add(Message(0, time, None), now=0)
        assert [match.messages[0].stamp for match in group.add(Message(1, time, None), now=0)] == [time]
    late = Message(0, -4 * START_NS, None)
    assert list(group.add(late, now=0)) == [Drop(late, DropReason.LATE)]


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"optional": (0, 1), "max_wait": 1}, "must be 2, one required"),
        ({"optional": (1,)}, "needs max_wait_ns"),
        ({"offsets_ns": (0,)}, "must be 2"),
        ({"max_wait": -1}, "must be 0 or more"),
        ({"restamp": 2}, "must be one of 2 inputs"),
        ({"restamp": -1}, "must be one of 2 inputs"),
        ({"restamp": Restamp.TICK}, "must have a policy with a clock"),
        ({"every": 0}, "must be 1 or more"),
        ({"period": 0}, "must be 1 or more"),
    ],
)
def test_options_out_of_range_are_refused(wrong, told):
    with pytest.raises(ValueError, match=told):
        exact(**wrong)


# What a type checker knows of payloads: `make lint` checks these two, and running them only shows that they run.


def test_the_payloads_of_a_group_that_says_its_type_are_of_it() -> None:
    group: SyncGroup[str] = SyncGroup(ExactTime(n_inputs=1, queue_size=1))
    (outcome,) = group.add(Message(0, 1, "a"), now=1)
    assert_type(outcome, Match[str] | Drop[str])
    assert isinstance(outcome, Match)
    assert_type(outcome.messages, tuple[Message[str] | None, ...])
    group.add(Message(0, 2, 2), now=1)  # type: ignore[arg-type]  # not a str


def test_payloads_of_a_group_that_does_not_say_may_be_anything() -> None:
    group: SyncGroup = SyncGroup(ExactTime(n_inputs=1, queue_size=1))
    (outcome,) = group.add(Message(0, 1, "a"), now=1)
    assert isinstance(outcome, Match)
    (message,) = outcome.messages
    assert message is not None
    assert_type(message.payload, Any)
