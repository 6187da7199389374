"""What `observe` ends with, by the reports of its groups."""

from syncrelay.explain import GroupReport, judge
from syncrelay.top.observed import unhealthy
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
