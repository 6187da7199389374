"""What `observe` ends with, by the reports of its groups."""

from syncrelay.explain import GroupReport, judge
from syncrelay.relay.look import is_early
from syncrelay.top.observed import unhealthy
from tests.explain.scenario import Source, always, nothing, run
from tests.explain.support.groups import NOW, S, a_group, an_input


def _report(facts) -> GroupReport:
    return GroupReport(facts, judge(facts))


def test_healthy_groups_are_no_fault():
    assert unhealthy([_report(a_group())], 10) == []


def test_what_decides_against_a_group_is_said_and_counted():
    too_short = _report(a_group(figures={"last_set": None, "sets": 0, "began": NOW - S}))
    lonely = _report(a_group(an_input(publishers=()), an_input("/lidar", publishers=())))
    assert unhealthy([_report(a_group()), lonely, too_short], 1.2, unjudged=["rear"]) == [
        "front has 1 warning",
        "front produced no set in 1 s, which is too short to tell why: observe it for longer",
        "rear could not be evaluated: see the log",
    ]


def _looked(hz, *, sends=always, clock=nothing) -> GroupReport:
    rig = Source("/camera", hz, sends=sends, clock=clock), Source("/lidar", hz)
    told = run(*rig, seconds=10, options={"slop": "20ms"}, facts=lambda _: {"is_look": True})
    return GroupReport(told.facts, told.found[-1][1])


def test_a_group_of_which_some_of_the_few_possible_sets_left_is_not_called_healthy():
    few = _looked(0.4, clock=lambda second: 0.3 if 2 < second < 3 else 0)
    assert unhealthy([few], 10) == [
        "front produced 2 of 3 possible sets so far, which is too soon to judge: observe it for longer"
    ]


def test_a_group_is_not_called_healthy_where_nothing_shows_how_many_sets_were_possible():
    (fault,) = unhealthy([_looked(1, sends=lambda second: int(second) in (1, 4, 6))], 10)
    assert fault == (
        "front produced 3 sets so far, but too few messages of /camera to tell how many were possible: observe it for"
        " longer"
    )
    assert unhealthy([_looked(1)], 10) == []


def test_a_look_goes_on_while_sets_have_just_stopped_and_nothing_says_why():
    assert not is_early(_looked(10))
    assert is_early(_looked(10, sends=lambda second: second < 8.6))
    # That an input is silent is known by then.
    assert not is_early(_looked(10, sends=lambda second: second < 3))
