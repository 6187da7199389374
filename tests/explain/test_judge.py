"""Every finding: the facts that come to it, the nearest that don't, and which of several explains a silence."""

import pytest

from syncrelay.explain import ClockState, Code, Finding, Severity, explanation, judge, with_ok
from syncrelay.explain.causes import EXPLAINS, explained_by
from syncrelay.explain.distribution import Distribution
from syncrelay.sync.messages import DropReason
from tests.explain.support import cases_flow, cases_graph, cases_stamps, cases_transforms
from tests.explain.support.cases import LIDAR, QUIET, STRANGER, UNFIT, camera, fed, said_of_cases, wide
from tests.explain.support.groups import MS, NOW, S, a_group, a_silent_group, an_input

FOUND = cases_graph.FOUND | cases_stamps.FOUND | cases_flow.FOUND | cases_transforms.FOUND
QUIETLY = [
    pytest.param(code, facts, id=name)
    for module in (cases_graph, cases_stamps, cases_flow, cases_transforms)
    for code, cases in module.QUIETLY.items()
    for name, facts in cases.items()
]
SAID = said_of_cases()


def found_in(facts):
    return with_ok(facts, judge(facts))


@pytest.mark.parametrize("name", FOUND)
def test_it_is_found_and_said(name):
    code, severity, text, suggestion = SAID[name]
    found = next((finding for finding in found_in(FOUND[name]) if finding.code is code), None)
    assert found is not None
    assert (found.severity, found.text, found.suggestion) == (severity, text, suggestion)


def test_what_is_said_is_said_of_a_case():
    assert SAID.keys() == FOUND.keys()


@pytest.mark.parametrize("name", FOUND)
def test_a_finding_is_as_bad_as_its_code_says_or_an_error_as_the_cause_of_a_silence(name):
    code, severity, *_ = SAID[name]
    assert severity in code.severities or (severity is Severity.ERROR and code in EXPLAINS)


@pytest.mark.parametrize(("code", "facts"), QUIETLY)
def test_it_is_not_found(code, facts):
    assert code not in {finding.code for finding in found_in(facts)}


@pytest.mark.parametrize("facts", FOUND.values(), ids=FOUND)
def test_nothing_is_found_twice(facts):
    found = judge(facts)
    assert len(found) == len(set(found))


def test_every_code_has_its_case():
    assert {code for code, *_ in SAID.values()} == set(Code)


def test_findings_explain_a_silence_in_the_order_of_the_codes():
    ill = camera(
        publishers=(STRANGER, UNFIT),
        counts=fed(needed_queue=40),
        figures={"dropped": dict.fromkeys((DropReason.MALFORMED, DropReason.UNSTAMPED, DropReason.OVERFLOW), 90)},
    )
    codes = [
        finding.code
        for finding in found_in(
            a_silent_group(ill, an_input("/lidar", publishers=()), clock=ClockState(received=True, stopped=S))
        )
    ]
    assert codes == sorted(codes, key=list(Code).index)
    assert len(set(codes)) >= 6


@pytest.mark.parametrize("facts", [a_silent_group(), *(facts for facts in FOUND.values() if facts.is_silent)])
def test_what_is_remarkable_of_a_silent_group_is_an_error_at_least(facts):
    assert Severity.ERROR in {finding.severity for finding in judge(facts)}


def test_nothing_is_remarkable_of_a_healthy_group_but_what_is_well():
    assert {each.severity for each in judge(a_group())} <= {Severity.OK}
    assert {each.severity for each in judge(FOUND["stamps that fell"])} == {Severity.OK}


def test_an_explanation_is_the_first_of_the_worst():
    ok, warn, error, worse = (
        Finding(Code.TIME_JUMP, Severity.OK, "a"),
        Finding(Code.DUPLICATES, Severity.WARN, "b"),
        Finding(Code.OVER_SLOP, Severity.ERROR, "c"),
        Finding(Code.SHORT_QUEUE, Severity.ERROR, "d"),
    )
    assert explanation((ok, warn, error, worse)) is error
    assert explanation((ok, warn)) is warn


def test_no_finding_explains_itself_by_way_of_others():
    def walk(code, path):
        assert code not in path, [*path, code]
        for other in explained_by(code):
            walk(other, [*path, code])

    for code in EXPLAINS:
        walk(code, [])


def test_a_relay_that_waited_briefly_explains_no_long_silence():
    quiet = camera(figures={**QUIET, "last_received": NOW - 6 * S})
    found = judge(a_silent_group(quiet, LIDAR, figures=wide(*[30] * 9), waited=S))
    assert {each.code for each in found} == {Code.TOO_SLOW, Code.SILENT}
    assert explanation(found).code is Code.SILENT


def test_a_pause_of_fewer_messages_than_were_too_wide_is_not_why():
    late = camera(figures={"received": tuple(NOW - n * 100 * MS for n in (33, 32, 26, *range(25, -1, -1)))})
    wide_sets = {"nearest": Distribution([3 * MS] * 60 + [500 * MS] * 30 + [3 * MS] * 10)}
    found = explanation(judge(a_group(late, LIDAR, figures=wide_sets)))
    assert found.code is Code.OVER_SLOP
    assert "paused" not in found.text
