"""Groups with a quorum: what is said while somebody is missing, and how the group stands."""

import re
from functools import partial

import pytest

from syncrelay.explain.codes import Severity
from syncrelay.explain.standing import Standing
from tests.explain.scenario import Source, run

OPTIONS = {"quorum": 2, "slop": "20ms", "max_wait": "60ms"}
NAMES = ("/top", "/left", "/right")


def _is_there(begin, end, second):
    return not begin <= second < end


def lidars(away, **faults):
    """Three lidars of 10 Hz, each away between two seconds if it is among those that are."""
    for place, name in enumerate(NAMES):
        begin, end = away.get(name, (0, 0))
        yield Source(
            name,
            10,
            phase_ms=place,
            topic_options={"min_period": "70ms"},
            jitter_ms=1,
            delay_jitter_ms=1,
            sends=partial(_is_there, begin, end),
            **faults.get(name, {}),
        )


def severities(told, since, until):
    return {each.severity for second, found in told.found if since <= second < until for each in found}


@pytest.mark.parametrize("dead", NAMES)
def test_a_group_without_one_of_three_stands_well_and_says_who_is_missing_for_good(dead):
    told = run(*lidars({dead: (20, 120)}), seconds=140, options=OPTIONS)
    assert {finding for _, found in told.found for finding in found if finding.severity is Severity.ERROR} == set()
    assert told.codes == {"silent"}
    assert told.first.topics == {dead}
    # A minute later too: one more, and no set leaves.
    last = next(found for second, found in told.found if second == 115)
    assert [(each.code.value, each.severity) for each in last] == [("silent", Severity.WARN)]
    assert told.facts.standing is Standing.ENOUGH
    assert severities(told, 130, 140) == set()


@pytest.mark.parametrize("alive", NAMES)
def test_a_group_without_two_of_three_is_silent_because_of_both(alive):
    dead = {name: (20, 40) for name in NAMES if name != alive}
    told = run(*lidars(dead), seconds=70, options=OPTIONS)
    at_worst = next(found for second, found in told.found if second == 35)
    assert {(each.code.value, each.severity) for each in at_worst} == {("silent", Severity.ERROR)}
    assert {NAMES[index] for each in at_worst for index in each.about} == set(dead)
    assert severities(told, 60, 70) == set()


def test_one_whose_clock_is_off_is_told_by_how_much():
    off = {"/top": {"clock": lambda _: 0.05}}
    told = run(*lidars({}, **off), seconds=40, options=OPTIONS)
    (finding,) = [each for each in told.found[-1][1] if each.severity is not Severity.OK]
    assert finding.code.value == "waiting_for_optional"
    assert finding.input == 0
    assert "the nearest sets with it span 4" in finding.text
    assert told.facts.standing is Standing.ENOUGH


def lidars_of(stamped_off_ms, tolerances):
    """Three lidars, each stamped so far off their common moment, of which some have a tolerance."""
    for name, off, tolerance in zip(NAMES, stamped_off_ms, tolerances, strict=True):
        keys = {"min_period": "70ms"} | ({"tolerance": tolerance} if tolerance else {})
        yield Source(name, 10, phase_ms=off, topic_options=keys, jitter_ms=0.2, delay_jitter_ms=1)


_CHECK = "check how these topics are stamped"


def test_one_that_its_tolerance_keeps_out_is_told_so_and_no_slop_is_offered():
    told = run(*lidars_of((0, 1, 16), (None, None, "2ms")), seconds=40, options=OPTIONS)
    (finding,) = [each for each in told.found[-1][1] if each.severity is not Severity.OK]
    assert (finding.code.value, finding.input) == ("waiting_for_optional", 2)
    over = "stamps of /right and /top are usually 16 ms apart, over tolerance 2 ms of /right plus half of slop 20 ms"
    assert over in finding.text
    gives = r"which would give (\d+) of \1 sets with /right \(now 0\)"
    assert re.fullmatch(rf"{_CHECK}, or write `tolerance: [789]ms` at /right, {gives}", finding.suggestion or "")


def test_where_a_tolerance_costs_half_of_the_sets_it_is_named():
    told = run(
        Source("/top", 20, topic_options={"tolerance": "2ms"}),
        Source("/left", 20, jitter_ms=4, topic_options={"tolerance": "1ms"}),
        seconds=40,
        options={"slop": "20ms"},
    )
    found = {each.code.value: each for each in told.found[-1][1] if each.severity is not Severity.OK}
    assert re.search(
        r"in (3|4|5)\d % of messages, stamps of /top and /left are up to [\d.]+ ms apart, over tolerance 2 ms of /top",
        found["over_slop"].text,
    )
    widths = r"`tolerance: (\d+)ms` at /top and `tolerance: (\d+)ms` at /left"
    given = re.search(rf"write {widths}, which would give (\d+) of \3 possible", found["over_slop"].suggestion or "")
    # 99 % of their stamps are up to 9.3 ms apart: by a normal distribution of 4 ms.
    assert given
    assert 9 < int(given[1]) + int(given[2]) <= 20


@pytest.mark.parametrize("options", [OPTIONS, {"slop": "20ms"}], ids=["two of three", "all required"])
def test_where_tolerances_let_no_set_leave_they_are_named_and_no_slop_is_offered(options):
    told = run(*lidars_of((0, 8, 16), ("2ms", "3ms", "2ms")), seconds=40, options=options)
    assert told.codes == {"over_slop"}
    finding = next(each for each in told.found[-1][1] if each.code.value == "over_slop")
    assert re.fullmatch(
        r"stamps of /top and /left are usually (7\.9\d*|8|8\.0\d*) ms apart, over tolerance 2 ms of /top plus"
        " tolerance 3 ms of /left",
        finding.text,
    )
    wider = "a wider `tolerance`"
    if options is not OPTIONS:
        # Two are 16 ms apart: half of slop is as far as each may reach.
        given = "which would give 100 of 100 possible sets (now 0)"
        wider = f"`tolerance: 10ms` at /top and `tolerance: 8ms` at /right, {given}"
    assert finding.suggestion == f"{_CHECK}, or write {wider}"
