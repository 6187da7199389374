"""Drift of a clock, told from what else makes delays grow."""

import random

import pytest

from syncrelay.explain.clocks import Drift, apart, drift
from syncrelay.explain.rules_drift import clock_drift
from tests.explain.support.cases import STEADY
from tests.explain.support.groups import BEGAN, MS, S, a_group, an_input
from tests.faults.extent import chosen


def points(delay, *, n=120, noise=0.0):
    """One point a second, of a delay in nanoseconds by the second."""
    source = random.Random(5)
    return [(BEGAN + second * S, round(delay(second) + source.gauss(0, noise))) for second in range(n)]


def is_straight(found):
    return found.drifted_ns > 8 * found.bend_ns


@pytest.mark.parametrize("ppm", [20, 100, 2000, -100])
def test_a_drift_is_measured_in_the_noise(ppm):
    found = drift(points(lambda second: second * ppm * 1000, noise=0.2 * MS))
    assert found is not None
    assert found.slope * 1e6 == pytest.approx(ppm, abs=3)
    assert found.watched_ns == 119 * S


@pytest.mark.parametrize(
    "delay",
    [
        lambda second: 20 * MS * (second > 60),
        lambda second: 20 * MS * (second > 30),
        lambda second: 20 * MS * (second > 105),
        lambda second: 60_000 * MS * (second > 60),
        lambda second: 20 * MS * (second % 60 > 45),
        lambda second: 10 * MS * (second / 60) ** 3,
    ],
    ids=["a step", "an early step", "a late step", "a pause", "a load that comes and goes", "a load that grows"],
)
def test_what_is_no_line_bends(delay):
    assert not is_straight(drift(points(delay, noise=0.1 * MS)))


def test_two_drifts_are_compared_over_the_shorter_time():
    one, other = Drift(0.5, 3.0, 60 * S, 0.03, 0.3), Drift(0.2, 1.0, 40 * S, 0.04, 0.4)
    assert apart(one, other) == pytest.approx(Drift(0.3, 4.0, 40 * S, 0.05, 0.5))


def is_told(found):
    """Whether a drift against a steady input is told."""
    return bool(list(clock_drift(a_group(an_input("/gps", figures={"drift": found}), STEADY))))


@pytest.mark.parametrize("seed", range(chosen(short=1, long=40)))
@pytest.mark.long
def test_a_few_delays_of_a_slow_sensor_that_lie_on_a_line_by_chance_are_no_drift(seed):
    chance = random.Random(seed)
    delays = [round(chance.uniform(-30 * MS, 30 * MS)) for _ in range(400)]
    # One of ten messages is lost.
    came = [(BEGAN + n * S, delay) for n, delay in enumerate(delays) if chance.random() > 0.1]
    parts = (came[begin:end] for begin in range(300) for end in range(begin + 5, begin + 12))
    told = [part for part in parts if is_told(drift(part))]
    assert not told
