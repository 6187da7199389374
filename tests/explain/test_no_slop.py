"""Groups without a slop: sets of any span leave, and what is odd about them is said all the same."""

import pytest

from syncrelay.explain.codes import Severity
from syncrelay.explain.standing import Standing
from tests.explain.scenario import Noise, Source, run

OPTIONS = {"slop": "none"}
NOISE: Noise = {"jitter_ms": 1, "delay_jitter_ms": 1}


def told_of(told):
    return {each.code.value for _, found in told.found for each in found if each.severity is not Severity.OK}


def test_a_healthy_pair_is_well():
    told = run(Source("/camera", 30, **NOISE), Source("/lidar", 10, phase_ms=20, **NOISE), seconds=30, options=OPTIONS)
    assert told_of(told) == set()
    assert told.facts.standing is Standing.ENOUGH


def test_stamps_of_another_clock_are_told_though_sets_leave():
    ahead = Source("/lidar", 10, clock=lambda _: 3600.0, **NOISE)
    told = run(Source("/camera", 30, **NOISE), ahead, seconds=40, options=OPTIONS)
    assert "other_clock" in told.codes


def test_messages_of_different_moments_are_told_though_sets_leave():
    behind = Source("/lidar", 10, clock=lambda _: -0.07, **NOISE)
    told = run(Source("/camera", 10, **NOISE), behind, seconds=60, options=OPTIONS)
    assert told.codes == {"constant_offset"}


@pytest.mark.parametrize("dead", ["/camera", "/lidar"])
def test_one_that_dies_is_told(dead):
    alive = next(name for name in ("/camera", "/lidar") if name != dead)
    dying = Source(dead, 10, sends=lambda second: second < 15, **NOISE)
    told = run(Source(alive, 10, **NOISE), dying, seconds=30, options=OPTIONS)
    assert told.codes == {"silent"}
    assert told.facts.standing is Standing.NONE
