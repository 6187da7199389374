"""What is found of a group that a clock triggers: its rate, inputs that stop, stamps off the clock or too old."""

import random
import re
from dataclasses import dataclass, replace

import pytest

from syncrelay.config import load_text
from syncrelay.explain import Code, Finding, GroupWatch, InputGraph, Severity, explanation, judge, with_ok
from tests.explain.scenario import Source, Told, run
from tests.explain.support.cases_stamps import AT_TICKS
from tests.explain.support.groups import S, a_silent_group, an_input
from tests.faults.extent import chosen

CAMERA = Source("/camera", hz=30)


def ran(*sources: Source, seconds: int = 30, trigger: str = "30 Hz", **keys) -> Told:
    return run(CAMERA, *sources, seconds=seconds, options={"policy": "latest_time", "trigger": trigger, **keys})


def last_of(told: Told) -> Finding:
    """The finding that explains most at the end."""
    return explanation(with_ok(told.facts, told.found[-1][1]))


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


@dataclass(frozen=True)
class Device:
    """A group at ticks, one input of which is stamped by a clock of its own; `is_young` where its messages could serve.

    How old the newest is that has come goes by its period and by what it is late by beyond the quickest.
    """

    sources: tuple[Source, Source]
    ticks_hz: int
    max_age: str
    is_young: bool

    def last_finding(self, **topic_options: str) -> Finding:
        quick, device = self.sources
        sources = quick, replace(device, topic_options=topic_options)
        options = {"policy": "latest_time", "trigger": f"{self.ticks_hz} Hz", "max_age": self.max_age}
        return last_of(run(*sources, seconds=25, options=options))


def a_device(chance: random.Random) -> Device:
    hz, is_young = 10 ** chance.uniform(0.3, 1.5), chance.random() < 0.6
    off, ppm = chance.choice([-1, 1]) * 10 ** chance.uniform(0.5, 9), chance.uniform(-200, 200)
    device = Source(
        "/device",
        hz=hz,
        delay_ms=chance.uniform(5, 60),
        delay_jitter_ms=0.03 * chance.random() * 1000 / hz,
        clock=lambda second: off + second * ppm * 1e-6,
    )
    # At four ticks a period or more, some come when three quarters of it are over.
    ticks_hz, periods = round(chance.uniform(4, 8) * hz) + 1, 1.5 if is_young else 0.6
    return Device((Source("/quick", hz=4 * hz), device), ticks_hz, f"{round(periods * 1000 / hz) + 5}ms", is_young)


@pytest.mark.parametrize("seed", range(chosen(short=10, long=100)))
def test_a_device_is_offered_to_be_mapped_where_that_brings_the_sets_of_a_clock(seed):
    device = a_device(random.Random(seed))
    finding = device.last_finding()
    assert (finding.code, finding.input) == (Code.OTHER_CLOCK, 1)
    assert ("`clock: device` at /device" in (finding.suggestion or "")) is device.is_young
    assert (device.last_finding(clock="device").code is Code.HEALTHY) is device.is_young


@pytest.mark.parametrize("off_s", [(40, 40), (40, -700)], ids=["by_one_clock", "by_two_clocks"])
def test_two_devices_that_are_off_the_clock_are_offered_to_be_mapped_together_and_that_cures(off_s):
    def rig(**topic_options: str) -> Finding:
        first, second = off_s
        sources = [
            Source("/a", hz=20, topic_options=topic_options, clock=lambda _: first),
            Source("/b", hz=8, topic_options=topic_options, clock=lambda _: second),
        ]
        options = {"policy": "latest_time", "trigger": "5 Hz", "max_age": "300ms"}
        return last_of(run(*sources, seconds=25, options=options))

    finding = rig()
    assert finding.code is Code.OTHER_CLOCK
    for topic in ("/a", "/b"):
        assert f"`clock: device` at {topic}" in (finding.suggestion or "")
    assert rig(clock="device").code is Code.HEALTHY


def test_a_device_is_not_offered_to_be_mapped_at_the_ticks_of_a_simulated_clock():
    config = load_text(
        "{version: 1, node: {use_sim_time: true}, groups: {front: {policy: latest_time, trigger: 10 Hz,"
        " topics: [{topic: /a}, {topic: /b}]}}}",
        environ={},
    )
    facts = GroupWatch(config.groups[0], began=0).facts([InputGraph("/a", "/o/a"), InputGraph("/b", "/o/b")], now=S)
    assert facts.suggester is None


def test_old_stamps_do_not_matter_where_any_age_will_do():
    inputs = [an_input(name, figures={"delay": None, "delays": (40 * S,) * 20}) for name in ("/camera", "/lidar")]
    found = judge(a_silent_group(*inputs, **{**AT_TICKS, "tolerance": None}))
    assert Code.OTHER_CLOCK not in [each.code for each in found]
