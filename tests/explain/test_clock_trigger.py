"""What is found of a group that a clock triggers: its rate, inputs that stop, stamps off the clock or too old."""

import re

import pytest

from syncrelay.config import load_text
from syncrelay.explain import Code, GroupWatch, InputGraph, Judge, Severity, explanation, judge, with_ok
from syncrelay.explain.dry_run import EngineDriver
from syncrelay.explain.facts import Endpoint
from syncrelay.sync import Match, Message
from tests.explain.support.cases import LIDAR, camera
from tests.explain.support.cases_stamps import AT_TICKS
from tests.explain.support.groups import BEGAN, MS, S, a_group, a_silent_group, an_input

IMAGE = "sensor_msgs/msg/Image"


def watched(keys, streams, *, until_s, own=""):
    """The finding that explains most at each second.

    `streams` are the period, delay and end of each topic's messages, in milliseconds.
    `own` are keys of the last topic alone.
    """
    *first, last = [f"      - {{topic: /{name}, type: {IMAGE}" for name in streams]
    topics = "".join(f"{topic}}}\n" for topic in [*first, f"{last}{own}"])
    text = f"version: 1\ngroups:\n  fixed:\n    policy: latest_time\n    {keys}\n    topics:\n{topics}"
    config = load_text(text).groups[0]
    messages = sorted(
        (BEGAN + (ms + delay) * MS, index, BEGAN + ms * MS)
        for index, (period, delay, end) in enumerate(streams.values())
        for ms in range(0, end, period)
    )
    sets: list[tuple[tuple[int | None, ...], int]] = []

    def take(outcomes, _now):
        sets.extend((each.stamps, 0) for each in outcomes if isinstance(each, Match))

    driver, watch, judge_of = EngineDriver(config, take), GroupWatch(config, began=BEGAN), Judge()
    publisher = (Endpoint("/driver", IMAGE),)
    graph = [InputGraph(f"/{name}", f"/fixed/{name}", publisher) for name in streams]
    told = []
    for second in range(1, until_s + 1):
        now = BEGAN + second * S
        came = [each for each in messages if now - S <= each[0] < now]
        for received, index, stamp in came:
            driver.add(Message(index, stamp, received), now=received)
        driver.expire(now)
        arrivals = [[(stamp, received) for received, at, stamp in came if at == index] for index in range(len(streams))]
        watch.add(arrivals, list(sets), driver.engine.counts(), driver.engine.sets, now=now)
        sets.clear()
        facts = watch.facts(graph, now=now)
        told.append(explanation(with_ok(facts, judge_of.judge(facts))))
    return told


def test_a_group_that_is_well_runs_at_the_rate_of_its_clock():
    finding = watched("trigger: 30 Hz", {"camera": (33, 5, 30_000), "lidar": (100, 20, 30_000)}, until_s=20)[-1]
    assert finding.code is Code.HEALTHY
    assert finding.text.startswith("30 of 30 ")


def test_an_input_that_stopped_is_why_no_set_leaves():
    keys = "trigger: 30 Hz\n    max_age: 500ms"
    finding = watched(keys, {"camera": (33, 5, 30_000), "lidar": (100, 20, 10_000)}, until_s=20)[-1]
    assert (finding.code, finding.severity, finding.input) == (Code.SILENT, Severity.ERROR, 1)


@pytest.mark.parametrize(
    ("max_age", "code"), [("20ms", Severity.ERROR), ("50ms", Severity.WARN)], ids=["at every tick", "at some"]
)
def test_messages_that_are_too_old_at_ticks_are_found_and_the_value_that_is_told_cures(max_age, code):
    streams = {"camera": (33, 5, 40_000), "lidar": (100, 30, 40_000)}
    finding = watched(f"trigger: 30 Hz\n    max_age: {max_age}", streams, until_s=30)[-1]
    assert (finding.code, finding.severity) == (Code.OVER_SLOP, code)
    assert "/lidar is 30 ms to 130 ms" in finding.text
    assert "`max_age: 180ms`" in (finding.suggestion or "")
    assert watched("trigger: 30 Hz\n    max_age: 180ms", streams, until_s=30)[-1].code is Code.HEALTHY


@pytest.mark.parametrize("trigger", ["30 Hz", "/camera"])
def test_an_input_that_is_too_old_for_its_own_age_is_found_and_the_value_that_is_told_cures(trigger):
    streams = {"camera": (33, 5, 40_000), "lidar": (33, 5, 40_000), "map": (1000, 5, 40_000)}
    keys = f"trigger: {trigger}\n    max_age: 100ms"
    finding = watched(keys, streams, until_s=30, own=", max_age: 300ms")[-1]
    assert (finding.code, finding.severity) == (Code.OVER_SLOP, Severity.WARN)
    assert "/map" in finding.text
    assert "`max_age: 1.3s` at /map" in (finding.suggestion or "")
    assert watched(keys, streams, until_s=30, own=", max_age: 1.3s")[-1].code is Code.HEALTHY


@pytest.mark.parametrize("trigger", ["30 Hz", "/camera"])
def test_what_is_sent_once_and_may_be_old_leaves_a_group_healthy(trigger):
    streams = {"camera": (33, 5, 40_000), "lidar": (33, 5, 40_000), "task": (1_000_000, 5, 40_000)}
    keys = f"trigger: {trigger}\n    max_age: 100ms"
    told = watched(keys, streams, until_s=30, own=", max_age: 60min")
    assert {each.code for each in told[10:]} == {Code.HEALTHY}


def test_a_longer_wait_is_offered_where_messages_are_only_late():
    streams = {"camera": (33, 5, 40_000), "lidar": (100, 150, 40_000)}
    finding = watched("trigger: 30 Hz\n    max_age: 120ms", streams, until_s=30)[-1]
    assert re.findall("`.*?`", finding.suggestion or "") == ["`max_age: 350ms`", "`max_wait: 200ms`"]
    cured = watched("trigger: 30 Hz\n    max_age: 120ms\n    max_wait: 200ms", streams, until_s=30)[-1]
    assert cured.code is Code.HEALTHY


def test_old_stamps_do_not_matter_where_any_age_will_do():
    inputs = [an_input(name, figures={"delay": None, "delays": (40 * S,) * 20}) for name in ("/camera", "/lidar")]
    found = judge(a_silent_group(*inputs, **{**AT_TICKS, "tolerance": None}))
    assert Code.OTHER_CLOCK not in [each.code for each in found]


def test_every_input_is_held_so_one_that_repeats_its_stamp_is_no_fault():
    repeating = camera(figures={"duplicates": 50})
    found = judge(a_group(repeating, LIDAR, **{**AT_TICKS, "tolerance": None}))
    assert Code.DUPLICATES not in [each.code for each in found]
