"""What a look ends with, by the reports of its groups."""

import pytest

from syncrelay.cli.boundary import AT_FAULT, DONE
from syncrelay.cli.explain import conclude
from syncrelay.explain import GroupReport, judge
from tests.explain.support.groups import NOW, S, a_group, an_input


def _report(facts) -> GroupReport:
    return GroupReport(facts, judge(facts))


def test_where_all_groups_are_healthy_the_code_is_0_and_nothing_decided_it(capsys: pytest.CaptureFixture[str]):
    assert conclude([_report(a_group())], 10) == DONE
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("front: ok: ")
    assert line.endswith("[healthy]")


def test_a_look_that_is_too_short_says_what_decided(capsys: pytest.CaptureFixture[str]):
    assert conclude([_report(a_group(figures={"last_set": None, "sets": 0, "began": NOW - S}))], 1.2) == AT_FAULT
    first, last = capsys.readouterr().out.splitlines()
    assert first.endswith("[starting]")
    assert last == (
        "exit code 1: front produced no set in 1 s, which is too short to tell why: give --explain a larger N"
    )


def test_findings_of_a_group_decide_and_are_counted(capsys: pytest.CaptureFixture[str]):
    lonely = _report(a_group(an_input(publishers=()), an_input("/lidar", publishers=())))
    assert conclude([_report(a_group()), lonely], 10) == AT_FAULT
    assert capsys.readouterr().out.splitlines()[-1] == "exit code 1: front has 1 warning"


def test_a_group_of_which_there_is_no_report_is_not_healthy(capsys: pytest.CaptureFixture[str]):
    assert conclude([_report(a_group())], 10, unjudged=["rear"]) == AT_FAULT
    assert capsys.readouterr().out.splitlines()[-1] == "exit code 1: rear could not be evaluated: see the log"
