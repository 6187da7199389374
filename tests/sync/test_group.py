"""What all policies share: lateness and disorder, drawn; offsets, common stamps, counts, options."""

import pytest

from syncrelay.sync import (
    Drop,
    DropReason,
    InputCounts,
    Message,
    Restamp,
)
from tests.sync.support.grouped import GAP, approximate, by_key, exact, latest
from tests.sync.support.timeline import START_NS, TICK_NS, group_cases, play_group, stamp

test_disorder = group_cases(
    {
        "older than what its input last gave is late, and so is as old": (
            exact,
            """
            left  |a.b.
            left  |..c.
            right |..B.
            arrive: B b a c
            -> b: bB
            -> a: a late
            -> c: c late
            """,
        ),
        "older than what its input has, but not late, is used": (
            exact,
            """
            left  |ab
            right |A.
            arrive: b a A
            -> A: aA
            """,
        ),
        "by key, the stamp of what was given may come again": (
            by_key,
            """
            left  |.a..
            left  |cb..
            right |.A..
            right |.B..
            keys: aA bB
            arrive: a A b B c
            -> A: aA
            -> B: bB
            -> c: c late
            """,
        ),
        "a stamp that falls by more than a second flushes the group, which starts afresh": (
            exact,
            f"""
            left  |d.{GAP}abc
            right |D.{GAP}.B
            arrive: a b B c d D
            -> B: a superseded, bB
            -> d: c time_jump
            -> D: dD
            """,
        ),
        "a second is late, but no jump": (
            exact,
            f"""
            left  |d{GAP[2:]}a
            right |D{GAP[2:]}A
            arrive: a A d D
            -> A: aA
            -> d: d late
            -> D: D late
            """,
        ),
        "what other inputs still send of the time before is dropped": (
            exact,
            f"""
            left  |d.{GAP}ab.
            right |D.{GAP}A.B
            arrive: a A b d B D
            -> A: aA
            -> d: b time_jump
            -> B: B time_jump
            -> D: dD
            """,
        ),
        "but nothing that could belong to the new time": (
            exact,
            f"""
            left  |e.{GAP}ab{GAP}f
            right |..{GAP}A.{GAP}F
            arrive: a A b e f F
            -> A: aA
            -> e: b time_jump
            -> F: e superseded, fF
            """,
        ),
    }
)


def test_an_unset_stamp_is_dropped_as_unstamped():
    group = exact()
    message = Message(0, 0, "a")
    assert group.add(message, now=1) == (Drop(message, DropReason.UNSTAMPED),)
    assert group.counts()[0].dropped == {DropReason.UNSTAMPED: 1}


def test_by_key_a_stamp_may_be_unset():
    group = by_key()
    for number in range(3):
        assert list(group.add(Message(0, 0, number, key=number), now=0)) == []
        (match,) = group.add(Message(1, 0, number, key=number), now=0)
        assert [message.payload for message in match.messages] == [number, number]
    assert [counts.matched for counts in group.counts()] == [3, 3]


def test_offsets_count_for_matching_and_messages_leave_with_the_stamps_they_came_with():
    group = exact(offsets_ns=(0, -12_000_000))
    first, second = Message(0, START_NS, "a"), Message(1, START_NS + 12_000_000, "A")
    assert group.add(first, now=0) == ()
    (match,) = group.add(second, now=0)
    assert match.messages == (first, second)


def test_offsets_of_required_inputs_count_for_the_optional_ones():
    group = exact(3, required=(True, True, False), max_wait=0, offsets_ns=(-5, -5, 0))
    for index, time in ((2, START_NS), (0, START_NS + 5)):
        group.add(Message(index, time, None), now=0)
    (match,) = group.add(Message(1, START_NS + 5, None), now=0)
    assert [message.input for message in match.messages] == [0, 1, 2]


@pytest.mark.parametrize(
    ("restamp", "expected"), [(None, None), (Restamp.EARLIEST, 0), (Restamp.LATEST, 3), (1, 3), (0, 0)]
)
def test_restamp_gives_the_set_a_common_stamp(restamp, expected):
    group = approximate(slop=5, restamp=restamp, offsets_ns=(0, -3 * TICK_NS))
    group.add(Message(0, stamp(0), "a"), now=0)
    (match,) = group.add(Message(1, stamp(3), "A"), now=0)
    assert match.stamp == (None if expected is None else stamp(expected))


def test_restamp_by_a_missing_input_gives_the_earliest_stamp():
    group = approximate(3, required=(True, True, False), slop=5, restamp=2, max_wait=0)
    group.add(Message(0, stamp(2), "a"), now=0)
    (match,) = group.add(Message(1, stamp(2), "A"), now=0)
    assert (match.messages[2], match.stamp) == (None, stamp(2))


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


@pytest.mark.parametrize(
    "options", [{}, {"max_wait": 5}, {"inputs": 3, "required": (False, True, True), "max_wait": 5}]
)
def test_counts_tell_the_queue_that_was_needed(options):
    group = approximate(queue=5, slop=1, **options)
    for column in range(20):
        group.add(Message(1, stamp(column), None), now=0)
    if len(group.counts()) == 3:
        group.add(Message(2, stamp(7), None), now=0)
        assert [counts.needed_queue for counts in group.counts()] == [None, 14, None]
    else:
        group.add(Message(0, stamp(7), None), now=0)
        assert [counts.needed_queue for counts in group.counts()] == [None, 14]


def test_a_served_message_of_latest_time_is_matched_once_and_not_buffered():
    group = latest(max_wait=None)
    for index, column in ((1, 0), (0, 1), (0, 2)):
        group.add(Message(index, stamp(column), None), now=0)
    trigger, odom = group.counts()
    assert (trigger.matched, odom.matched, odom.buffered, group.sets) == (2, 1, 0, 2)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"required": (True,)}, "must be 2, one required"),
        ({"required": (False, False), "max_wait": 1}, "must be 2, one required"),
        ({"required": (True, False)}, "needs max_wait_ns"),
        ({"offsets_ns": (0,)}, "must be 2"),
        ({"max_wait": -1}, "must be 0 or more"),
        ({"restamp": 2}, "must be one of 2 inputs"),
        ({"restamp": -1}, "must be one of 2 inputs"),
        ({"every": 0}, "must be 1 or more"),
        ({"min_set_period_ns": 0}, "must be 1 or more"),
    ],
)
def test_options_out_of_range_are_refused(wrong, told):
    with pytest.raises(ValueError, match=told):
        exact(**wrong)


def test_a_drawing_is_played_with_the_clock_of_its_columns():
    left, drawn = play_group(exact(), "left |a\nright |A\n-> A: aA")
    assert left == drawn
