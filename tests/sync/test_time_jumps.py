"""Stamps that fall by more than a second: a new time begins, on all inputs, and nothing of the old one stays."""

import pytest

from syncrelay.sync import (
    Drop,
    DropReason,
    Message,
)
from tests.sync.support.grouped import by_key, exact
from tests.sync.support.timeline import START_NS, stamp


def test_by_key_an_unset_stamp_is_no_jump_and_makes_nothing_less_late():
    group = by_key()
    for number, time in ((1, START_NS), (2, 0)):
        group.add(Message(0, time, number, key=number), now=0)
        (match,) = group.add(Message(1, time, number, key=number), now=0)
        assert [message.payload for message in match.messages] == [number, number]
    late = Message(0, START_NS - 1, 3, key=3)
    assert list(group.add(late, now=0)) == [Drop(late, DropReason.LATE)]


def test_an_input_that_fell_too_belongs_to_the_new_time_however_far_ahead_it_is():
    group = exact(queue=9)
    for index, column in ((0, 300), (1, 310), (0, 100)):
        group.add(Message(index, stamp(column), column), now=0)
    assert group.add(Message(1, stamp(205), 205), now=0) == []
    assert group.counts()[1].buffered == 1


def test_one_stamp_far_ahead_costs_no_more_than_what_was_buffered():
    group = exact()
    told = []
    for index, column in ((0, 10), (1, 10), (0, 90_000), (0, 12), (1, 12), (0, 14), (1, 14)):
        told += group.add(Message(index, stamp(column), column), now=0)
    assert [getattr(outcome, "reason", None) for outcome in told] == [None, DropReason.TIME_JUMP, None, None]


@pytest.mark.parametrize("offsets", [(0, 0), (-7, 0), (0, -7), (4, -7)])
@pytest.mark.parametrize(
    ("before", "column", "left_over"),
    [(90, 100, False), (90, 101, True), (150, 150, False), (150, 151, True), (150, 250, True), (150, 251, False)],
)
def test_left_over_is_what_goes_on_by_a_second_where_its_input_was_and_is_more_than_a_second_ahead(
    before, column, left_over, offsets
):
    offsets_ns = [offset * 1_000_000_000 for offset in offsets]
    group = exact(queue=9, offsets_ns=offsets_ns)
    for index, time in ((1, before), (0, 900), (0, 0), (1, column)):
        told = group.add(Message(index, stamp(time) - offsets_ns[index], time), now=0)
    assert [drop.reason.value for drop in told] == ["time_jump"] * left_over


def test_a_flush_forgets_where_each_input_was():
    group = exact()
    for index, column in ((0, 500), (1, 510)):
        group.add(Message(index, stamp(column), column), now=0)
    group.flush(DropReason.TIME_JUMP)
    for index, column in ((0, 100), (1, 520)):
        assert list(group.add(Message(index, stamp(column), column), now=0)) == []


def test_two_jumps_in_a_row_are_two():
    # Input 1 still has something of the first time when input 0 jumps once more.
    group = exact()
    told = []
    for index, column in ((1, 900), (0, 900), (0, 500), (0, 100), (1, 910), (1, 100)):
        told.append(list(group.add(Message(index, stamp(column), column), now=0)))
    assert [drop.reason.value for drop in told[4]] == ["time_jump"]
    assert [message.payload for message in told[5][0].messages] == [100, 100]


def test_any_input_may_be_the_first_to_begin_a_new_pass():
    group = exact()
    recording = [Message(index, stamp(column), column) for column in (0, 150, 300) for index in (0, 1)]
    for turn in range(4):
        first = turn % 2
        for message in sorted(recording, key=lambda message: (message.stamp, message.input != first)):
            group.add(message, now=0)
        assert group.sets == 3 * (turn + 1)


def test_stamps_below_zero_match_and_are_late_but_never_jump():
    group = exact()
    for time in (-9 * START_NS, -3 * START_NS):
        group.add(Message(0, time, None), now=0)
        assert [match.messages[0].stamp for match in group.add(Message(1, time, None), now=0)] == [time]
    late = Message(0, -4 * START_NS, None)
    assert list(group.add(late, now=0)) == [Drop(late, DropReason.LATE)]
