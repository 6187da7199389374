"""What is found of a group that a clock triggers: its rate, inputs that stop, stamps off the clock or too old."""

import re

import pytest

from syncrelay.explain import Code, Finding, Severity, explanation, judge, with_ok
from tests.explain.scenario import Source, Told, run
from tests.explain.support.cases import LIDAR, camera
from tests.explain.support.cases_stamps import AT_TICKS
from tests.explain.support.groups import S, a_group, a_silent_group, an_input

CAMERA = Source("/camera", hz=30)


def ran(*sources: Source, seconds: int = 30, trigger: str = "30 Hz", **keys) -> Told:
    return run(CAMERA, *sources, seconds=seconds, options={"policy": "latest_time", "trigger": trigger, **keys})


def last_of(told: Told) -> Finding:
    """The finding that explains most at the end."""
    return explanation(with_ok(told.facts, told.found[-1][1]))


def test_a_group_that_is_well_runs_at_the_rate_of_its_clock():
    finding = last_of(ran(Source("/lidar", hz=10, delay_ms=20)))
    assert finding.code is Code.HEALTHY
    assert finding.text.startswith("30 of 30 ")


def test_an_input_that_stopped_is_why_no_set_leaves():
    finding = last_of(ran(Source("/lidar", hz=10, sends=lambda second: second < 10), seconds=20, max_age="500ms"))
    assert (finding.code, finding.severity, finding.input) == (Code.SILENT, Severity.ERROR, 1)


@pytest.mark.parametrize(
    ("max_age", "severity"), [("20ms", Severity.ERROR), ("50ms", Severity.WARN)], ids=["at every tick", "at some"]
)
def test_messages_that_are_too_old_at_ticks_are_found_and_the_value_that_is_told_cures(max_age, severity):
    lidar = Source("/lidar", hz=10, delay_ms=30)
    finding = last_of(ran(lidar, max_age=max_age))
    assert (finding.code, finding.severity) == (Code.OVER_SLOP, severity)
    assert "/lidar is 30 ms to 130 ms" in finding.text
    assert "`max_age: 180ms`" in (finding.suggestion or "")
    assert last_of(ran(lidar, max_age="180ms")).code is Code.HEALTHY


@pytest.mark.parametrize("trigger", ["30 Hz", "/camera"])
def test_an_input_that_is_too_old_for_its_own_age_is_found_and_the_value_that_is_told_cures(trigger):
    def with_map(max_age: str) -> Finding:
        rarely = Source("/map", hz=1, topic_options={"max_age": max_age})
        return last_of(ran(Source("/lidar", hz=30), rarely, trigger=trigger, max_age="100ms"))

    finding = with_map("300ms")
    assert (finding.code, finding.severity) == (Code.OVER_SLOP, Severity.WARN)
    assert "/map" in finding.text
    assert "`max_age: 1.3s` at /map" in (finding.suggestion or "")
    assert with_map("1.3s").code is Code.HEALTHY


@pytest.mark.parametrize("trigger", ["30 Hz", "/camera"])
def test_what_is_sent_once_and_may_be_old_leaves_a_group_healthy(trigger):
    once = Source("/task", hz=0.001, topic_options={"max_age": "60min"})
    told = ran(Source("/lidar", hz=30), once, trigger=trigger, max_age="100ms")
    assert told.ever_found == set()
    assert last_of(told).code is Code.HEALTHY


def test_a_longer_wait_is_offered_where_messages_are_only_late():
    late = Source("/lidar", hz=10, delay_ms=150)
    finding = last_of(ran(late, max_age="120ms"))
    assert re.findall("`.*?`", finding.suggestion or "") == ["`max_age: 350ms`", "`max_wait: 200ms`"]
    assert last_of(ran(late, max_age="120ms", max_wait="200ms")).code is Code.HEALTHY


def test_old_stamps_do_not_matter_where_any_age_will_do():
    inputs = [an_input(name, figures={"delay": None, "delays": (40 * S,) * 20}) for name in ("/camera", "/lidar")]
    found = judge(a_silent_group(*inputs, **{**AT_TICKS, "tolerance": None}))
    assert Code.OTHER_CLOCK not in [each.code for each in found]


def test_every_input_is_held_so_one_that_repeats_its_stamp_is_no_fault():
    repeating = camera(figures={"duplicates": 50})
    found = judge(a_group(repeating, LIDAR, **{**AT_TICKS, "tolerance": None}))
    assert Code.DUPLICATES not in [each.code for each in found]
