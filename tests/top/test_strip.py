"""Strips of groups written by hand."""

# ruff: noqa: RUF001  the marks are what they look like

import pytest

from syncrelay.explain import RecentDrop, RecentSet
from syncrelay.sync.messages import DropReason
from syncrelay.top.strip import MARKS, UNNEEDED, Window, mark_of, newest_stamp, strip, window_of

MS = 1_000_000
# A column is 20 ms, so the first one begins at the stamp 0.
_WINDOW = Window(head=380 * MS, width=20, column_ns=20 * MS)


def a_set(*stamps_ms):
    return RecentSet(tuple(None if stamp is None else round(stamp * MS) for stamp in stamps_ms))


def a_drop(lane, stamp_ms, reason=DropReason.SUPERSEDED, *, unneeded=None):
    return RecentDrop(lane, round(stamp_ms * MS), reason, unneeded)


def drawn(recent, window=_WINDOW, *, inputs=2, sets=None):
    """The lines of a strip; by default the group has given no sets before the recent ones."""
    given = sum(hasattr(each, "stamps") for each in recent) if sets is None else sets
    return [line.plain.rstrip() for line in strip(recent, window, n_inputs=inputs, sets=given)]


@pytest.mark.parametrize(
    ("recent", "lanes"),
    [
        pytest.param(
            [a_set(45, 41), a_set(145, 141), a_set(240, 245)],
            ["  A    B    C", "  │    │    │", "  A    B    C", " 4.0  4.0  5.0"],
            id="a set is a letter on each lane, a joint between them, its span below",
        ),
        pytest.param(
            [a_set(45, 65), a_set(185, 165)],
            ["  A      B", "  ╰╮    ╭╯", "   A    B", "  20.0 20.0"],
            id="joints lean as the stamps do",
        ),
        pytest.param(
            [a_drop(0, 40), a_drop(0, 60, DropReason.LATE), a_drop(1, 80, DropReason.TOO_FAR)],
            ["  »<", "", "    ×", ""],
            id="unmatched messages are marked by their reason",
        ),
        pytest.param(
            [a_drop(0, 40, DropReason.OVERFLOW), a_drop(0, 45), a_drop(1, 40), a_set(41, 45)],
            ["  A", "  │", "  A", " 4.0"],
            id="where several share a column, a set hides drops",
        ),
        pytest.param(
            [a_drop(0, 40, DropReason.OVERFLOW), a_drop(0, 45, unneeded=True)],
            ["  !", "", "", ""],
            id="where several share a column, a loss hides what was not needed",
        ),
        pytest.param(
            [a_set(45, None), a_set(None, 145)],
            ["  A", "", "       B", " 0.0  0.0"],
            id="a missing optional message leaves its lane empty and has no joint",
        ),
        pytest.param([a_set(-1, -20)], ["", "", "", ""], id="what is older than the strip is not on it"),
    ],
)
def test_messages_stand_on_their_lanes_by_their_stamps(recent, lanes):
    assert drawn(recent) == lanes


def test_a_set_keeps_its_letter_when_older_ones_are_forgotten():
    assert drawn([a_set(45, 45), a_set(145, 145)], sets=29)[0] == "  B    C"


def test_three_inputs_have_three_lanes():
    assert drawn([a_set(40, 60, 60)], inputs=3) == ["  A", "  ╰╮", "   A", "   │", "   A", "  20.0"]


def test_each_reason_has_a_mark_of_its_own():
    assert set(MARKS) == set(DropReason)
    characters = [mark.character for mark in (UNNEEDED, *MARKS.values())]
    assert len(set(characters)) == len(DropReason) + 1
    assert all(len(each) == 1 and not each.isupper() for each in characters)


def test_the_newest_stamp_is_looked_for_in_sets_and_drops():
    assert newest_stamp([a_set(45, None), a_drop(0, 50)]) == 50 * MS
    assert newest_stamp([]) == 0


@pytest.mark.parametrize(
    ("reason", "unneeded", "mark"),
    [
        (DropReason.TOO_FAR, False, ("×", "bold red")),
        (DropReason.TOO_FAR, None, ("×", "bold red")),
        (DropReason.TOO_FAR, True, ("·", "dim")),
        (DropReason.THINNED, False, ("-", "dim")),
        (DropReason.LATE, False, ("<", "bold red")),
    ],
)
def test_a_drop_stands_out_where_it_costs_a_set(reason, unneeded, mark):
    assert mark_of(RecentDrop(0, 1, reason, unneeded)) == mark


def test_sets_are_told_apart_by_colour_and_by_letter():
    lane = strip([a_set(45, 45), a_set(145, 145)], _WINDOW, n_inputs=2, sets=2)[0]
    letters = {lane.plain[span.start : span.end].strip(): str(span.style) for span in lane.spans}
    assert letters["A"] != letters["B"]


@pytest.mark.parametrize(
    ("recent", "column_ms"),
    [
        pytest.param([a_set(n * 100, n * 100 - 3) for n in range(9)], 20, id="10 Hz"),
        pytest.param([a_set(n * 5, n * 5) for n in range(9)], 1, id="200 Hz"),
        pytest.param([a_set(n * 1000, n * 990) for n in range(9)], 200, id="1 Hz"),
        pytest.param([a_set(n * 60_000, n * 60_000) for n in range(9)], 10_000, id="one a minute"),
        pytest.param([a_drop(0, n * 33) for n in range(31)], 50, id="no sets: all that happened"),
        pytest.param([a_drop(0, 0), a_drop(1, 1e12)], 10_000, id="stamps that were never set do not count"),
        pytest.param([], 1, id="nothing yet"),
    ],
)
def test_a_window_is_scaled_to_how_often_sets_leave(recent, column_ms):
    assert window_of(recent, 20).column_ns == column_ms * MS
