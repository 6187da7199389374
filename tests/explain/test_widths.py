"""How wide a tolerance is suggested: of two drawn inputs whose clocks run off each other by a known rate."""

import random

import numpy as np
import pytest

from syncrelay.config import Distance
from syncrelay.config.units import parse_duration
from syncrelay.explain.nearest import sides
from syncrelay.explain.possible_sets import possible_sets
from syncrelay.explain.received import as_arrays
from syncrelay.explain.widths import tolerances, wander, with_headroom
from syncrelay.sync import Message
from tests.explain.scenario import BEGAN, MS, Source, group_of
from tests.faults.extent import chosen

S = 1_000_000_000


def stamps(
    period_ms: float, seconds: float, *, phase_ms: float = 0, ppm: float = 0, jitter_ms: float = 0, seed: int = 0
):
    count = int(seconds * 1000 / period_ms)
    jitter = np.random.default_rng(seed).normal(0, jitter_ms, count)
    times = phase_ms + np.arange(count) * period_ms * (1 + ppm * 1e-6) + jitter
    return BEGAN + (np.sort(times) * MS).astype(np.int64)


def offered(*inputs) -> tuple[str, ...]:
    messages = [Message(index, each, each) for index, of in enumerate(inputs) for each in of.tolist()]
    config = group_of([Source(f"/input_{index}", hz=1) for index in range(len(inputs))], {"slop": "1ms"})
    arrays = as_arrays(sorted(messages, key=lambda each: each.payload), len(inputs))
    possible = possible_sets(config, arrays, range(len(inputs)), is_window=False)
    assert possible is not None
    return tolerances(possible, inputs, Distance.SPAN)


def test_clocks_that_run_off_each_other_are_told_from_those_of_one_trigger():
    for seed in range(chosen(short=200, long=4000)):
        chance = random.Random(f"wander {seed}")
        period, jitter = chance.choice([10, 30, 100]), chance.choice([0, 0.01, 0.1])
        ppm = chance.choice([0, chance.uniform(20, 100)])
        one = stamps(period, 20, jitter_ms=jitter, seed=2 * seed)
        other = stamps(period, 20, phase_ms=period / 4, ppm=ppm, jitter_ms=jitter, seed=2 * seed + 1)
        found = wander(one, other)
        assert abs(found.rate - ppm * 1e-6) <= 5 * found.error + 1e-9, seed
        assert found.is_evident is (ppm > 0) or ppm * 1e-6 < 10 * found.error, seed


def test_inputs_that_run_free_are_offered_half_a_period_and_those_of_one_trigger_what_they_need():
    one = stamps(100, 20)
    assert [parse_duration(each) for each in offered(one, stamps(100, 20, phase_ms=10))] == [10 * MS]
    (wide,) = offered(one, stamps(100, 20, phase_ms=10, ppm=40))
    assert 50 * MS <= parse_duration(wide) < 60 * MS


def test_what_holds_for_seconds_holds_for_a_minute():
    """The tolerance of the first 8 s is enough for what comes in the minute after."""
    for seed in range(chosen(short=100, long=2000)):
        chance = random.Random(f"holds {seed}")
        period, ppm = chance.choice([20, 100, 400]), chance.choice([0, chance.uniform(-40, 40)])
        keys = {
            "ppm": ppm,
            "phase_ms": chance.uniform(0.05, 0.3) * period,
            "jitter_ms": chance.uniform(0, 0.03) * period,
        }
        one, other = stamps(period, 68), stamps(period, 68, seed=seed, **keys)
        until = BEGAN + 8 * S
        found = offered(one[one < until], other[other < until])
        assert found, seed
        later = one[one >= until][:-2]
        near = sides(later, other)
        spans = np.minimum(near.before, near.after)
        assert np.mean(spans <= parse_duration(found[0])) >= 0.95, (seed, found, keys)


def test_the_fewer_spans_there_are_the_more_room_is_left():
    few, many = np.linspace(MS, 9 * MS, 9).astype(np.int64), np.linspace(MS, 9 * MS, 900).astype(np.int64)
    assert 12 * MS < parse_duration(with_headroom(few)) < 16 * MS
    assert 11 * MS <= parse_duration(with_headroom(many)) <= 12 * MS


@pytest.mark.parametrize(
    ("slow_ms", "phase_ms", "is_offered"),
    [
        (100, 30, True),
        (100, 38, True),
        (100, 43, False),
        (100, 50, False),
        (100, 57, False),
        (900, 50, False),
        # Either partner of a message that comes so seldom is of nearly its moment.
        (1000, 38, True),
        (1000, 43, True),
        (1000, 50, True),
    ],
)
def test_no_tolerance_is_offered_for_what_lies_amid_two_unless_both_are_of_nearly_its_moment(
    slow_ms, phase_ms, is_offered
):
    assert bool(offered(stamps(slow_ms, 20), stamps(100, 20, phase_ms=phase_ms))) is is_offered


def test_no_tolerance_is_offered_for_slow_inputs_that_are_apart_by_more_than_half_a_period_of_a_quick_one():
    slow = [stamps(1000, 20), stamps(1000, 20, phase_ms=150)]
    assert offered(*slow, stamps(100, 20)) == ()
