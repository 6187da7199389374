"""Causes and effects: the table itself, and what each cause hides of its effects."""

import pytest

from syncrelay.clock import Step
from syncrelay.explain import (
    Code,
    Endpoint,
    GraphSnapshot,
    Judge,
    Severity,
    Share,
    Standing,
    Standstill,
    explanation,
    judge,
    with_ok,
)
from syncrelay.explain.causes import EXPLAINS, explained_by
from syncrelay.explain.epochs import Reading
from syncrelay.explain.known_soon import known_soon
from syncrelay.sync.messages import DropReason
from tests.explain.support.cases import LIDAR, QUIET, camera, dropped, overflowing, wide
from tests.explain.support.cases_stamps import AT_TICKS
from tests.explain.support.groups import MS, NOW, S, a_group, a_silent_group, an_input

WIDE = wide(*[5] * 40, *[30] * 60)
SLOWED = {"pace_hz": 5.0, "slowed_from_hz": 10.0}


def codes(found):
    """The codes of what is wrong."""
    return [each.code for each in found if each.severity is not Severity.OK]


def test_no_finding_explains_itself_by_way_of_others():
    def walk(code, path):
        assert code not in path, [*path, code]
        for other in explained_by(code):
            walk(other, [*path, code])

    for code in EXPLAINS:
        walk(code, [])


@pytest.mark.parametrize(
    ("lost", "possible", "found"),
    [(1, 100, [Code.FEW_SETS, Code.MESSAGES_LOST]), (25, 100, [Code.MESSAGES_LOST]), (25, 20, [Code.MESSAGES_LOST])],
)
def test_losses_explain_what_is_missing_where_they_account_for_most_of_it(lost, possible, found):
    share = {"share": Share(possible // 2, possible, 10 * S)}
    few = judge(a_group(camera(lost=lost), LIDAR, figures=share, standing=Standing.FEW))
    assert codes(few) == found
    assert [each.severity for each in few] == [Severity.WARN] * len(found)
    silent = judge(a_silent_group(camera(lost=lost), LIDAR, figures={"share": Share(0, possible // 2, 10 * S)}))
    assert [each.code for each in silent if each.severity is Severity.ERROR] == [
        Code.UNEXPLAINED if len(found) > 1 else Code.MESSAGES_LOST
    ]


def test_an_input_whose_messages_cannot_be_read_is_not_silent():
    unread = dropped(DropReason.MALFORMED, 70, **{**QUIET, "fed": 70})
    assert codes(judge(a_group(unread, LIDAR))) == [Code.MALFORMED]


def test_what_is_so_of_two_publishers_that_have_no_names_yet_is_found_once():
    stranger = Endpoint("a publisher whose node is not known yet", "std_msgs/msg/Int64", is_named=False)
    assert codes(judge(a_group(camera(publishers=(stranger, stranger)), LIDAR))) == [Code.OTHER_TYPE]


def test_an_inactive_node_explains_all_but_what_can_be_mended_before_it_is_active():
    ill = camera(publishers=(), figures={"last_received": None}, counts=overflowing(40).counts)
    silent = a_silent_group(ill, LIDAR, figures=WIDE, waited=3 * S, inactive="/syncrelay")
    assert codes(judge(silent)) == [Code.INACTIVE]
    assert explanation(with_ok(silent, judge(silent))).severity is Severity.WARN
    stranger = camera(publishers=(Endpoint("/usb_cam", "std_msgs/msg/Int64"),))
    assert codes(judge(a_silent_group(stranger, LIDAR, inactive="/syncrelay"))) == [Code.INACTIVE, Code.OTHER_TYPE]
    assert codes(judge(a_group(LIDAR, failure="KeyError", inactive="/syncrelay"))) == [
        Code.INTERNAL_ERROR,
        Code.INACTIVE,
    ]


def test_a_cause_is_remembered_while_the_messages_of_its_time_are_judged_by():
    a_judge = Judge()
    assert codes(a_judge.judge(a_group(figures=WIDE, waited=3 * S))) == [Code.TOO_SLOW]
    since = {**WIDE, "nearest_from": NOW - S}
    assert codes(a_judge.judge(a_group(figures={**since, "now": NOW + 9 * S, "last_set": NOW + 9 * S}))) == []
    later = {**WIDE, "nearest_from": NOW + S, "now": NOW + 11 * S, "last_set": NOW + 11 * S}
    assert codes(a_judge.judge(a_group(figures=later))) == [Code.OVER_SLOP]


@pytest.mark.parametrize(("since", "found"), [(NOW, []), (NOW + 5 * S, [Code.OVER_SLOP])])
def test_at_ticks_a_cause_is_remembered_while_the_delays_of_its_time_are_judged_by(since, found):
    a_judge, later = Judge(), {"rate_hz": 5.0, **dict.fromkeys(("now", "last_set", "nearest_from"), NOW + 9 * S)}
    late = {"pace_hz": 10.0, "delays": (S,) * 20, "received": [since + n * 100 * MS for n in range(20)]}
    assert codes(a_judge.judge(a_group(waited=3 * S, **AT_TICKS))) == [Code.TOO_SLOW]
    both = camera(figures=late), an_input("/lidar", figures=late)
    assert codes(a_judge.judge(a_group(*both, figures=later, **AT_TICKS))) == found


def test_sets_that_were_too_wide_until_now_are_why_they_are_missing():
    a_judge, half = Judge(), {"share": Share(50, 100, 10 * S)}
    (wide_now,) = a_judge.judge(a_group(figures={**WIDE, **half}, standing=Standing.FEW))
    (after,) = a_judge.judge(a_group(figures={**half, "now": NOW + 2 * S}, standing=Standing.FEW))
    assert (after.code, after.is_over) == (Code.OVER_SLOP, True)
    assert after.text == f"50 of 100 possible sets left in the last 10 s; until 2 s ago, {wide_now.text}"
    missing = {**half, "now": NOW + 4 * S, "shares": lambda _: Share(10, 20, 3 * S)}
    assert codes(a_judge.judge(a_group(figures=missing, standing=Standing.FEW))) == [Code.FEW_SETS]


def test_of_two_causes_that_are_over_the_one_that_ended_last_is_why_sets_are_missing():
    a_judge, half = Judge(), {"share": Share(50, 100, 10 * S)}
    stood = {"waited": 3 * S, "standstills": (Standstill(NOW - 4 * S, 3 * S),)}
    slowed = camera(figures=SLOWED)
    a_judge.judge(a_group(slowed, LIDAR, figures=half, standing=Standing.FEW))
    a_judge.judge(a_group(figures={**half, "now": NOW + S}, standing=Standing.FEW, **stood))
    (after,) = a_judge.judge(a_group(figures={**half, "now": NOW + 2 * S}, standing=Standing.FEW))
    assert (after.code, after.is_over) == (Code.SLOWED, True)


def test_what_the_stamps_of_an_input_show_is_not_explained_by_those_of_another():
    two = Endpoint("/a", "sensor_msgs/msg/Image"), Endpoint("/b", "sensor_msgs/msg/Image")
    both = camera(publishers=two, figures={"swings": 2, "swung_by": 3 * S})
    misread = an_input("/lidar", figures={"reading": Reading("are milliseconds", 1e-6, is_unit=True), "stamps": (1, 2)})
    assert codes(judge(a_group(both, misread))) == [Code.SEVERAL_PUBLISHERS, Code.OTHER_CLOCK]


def test_steps_at_different_times_are_not_one_of_all_inputs():
    def stepped(ago):
        steps = (Step(NOW - ago, 3 * S), Step(NOW - S, 3 * S))
        inputs = [an_input(name, figures={"stepped": step}) for name, step in zip("ab", steps, strict=True)]
        return [each.inputs or each.input for each in judge(a_group(*inputs)) if each.code is Code.CLOCK_STEP]

    assert stepped(2 * S) == [None]
    assert stepped(9 * S) == [0, 1]


def test_the_unit_of_a_fast_input_that_has_come_for_long_is_known():
    fast = {"received": tuple(NOW - 4 * MS * n for n in range(200, 0, -1)), "rate_hz": 250.0}
    group = a_group(camera(figures=fast), an_input("/lidar", figures=fast))
    assert known_soon(group, Code.OTHER_CLOCK) == ""
    began = a_group(camera(figures={**fast, "flows_since": NOW - 800 * MS}), an_input("/lidar", figures=fast))
    assert "another unit or rate" in known_soon(began, Code.OTHER_CLOCK)


def test_who_is_still_missing_when_others_come_is_told_at_once():
    missing = [an_input(name, publishers=(), figures={"last_received": None}) for name in ("/camera", "/lidar")]
    a_judge = Judge()
    assert codes(a_judge.judge(a_group(*missing, empty_graph=GraphSnapshot(0, "SUBNET")))) == [Code.ALONE]
    assert codes(a_judge.judge(a_group(*missing, figures={"now": NOW + S}))) == [Code.NO_PUBLISHER]


@pytest.mark.parametrize(
    ("an_input", "said"),
    [
        (camera(figures={"delay": 18 * S}), Code.OTHER_CLOCK),
        (dropped(DropReason.UNSTAMPED, 100), Code.UNSTAMPED),
        (dropped(DropReason.MALFORMED, 100), Code.MALFORMED),
        (camera(figures=SLOWED), Code.SLOWED),
        (camera(figures={"duplicates": 50}), Code.DUPLICATES),
    ],
)
def test_a_relay_with_too_little_cpu_hides_nothing_that_it_cannot_cause(an_input, said):
    silent = a_silent_group(an_input, LIDAR, figures=wide(*[30] * 9), waited=S)
    found = judge(silent)
    assert set(codes(found)) == {Code.TOO_SLOW, said}
    assert explanation(found).code is said
