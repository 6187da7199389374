"""A histogram counts each value once, under the least bound that is not below it."""

import pytest

from syncrelay.explain import BOUNDS_NS
from syncrelay.explain.distribution import EMPTY, Tallied


def test_the_bounds_are_round_and_rise():
    assert BOUNDS_NS[0] == 100_000
    assert BOUNDS_NS[-1] == 5_000_000_000
    assert list(BOUNDS_NS) == sorted(set(BOUNDS_NS))


@pytest.mark.parametrize(
    ("value", "place"),
    [(0, 0), (100_000, 0), (100_001, 1), (5_000_000_000, len(BOUNDS_NS) - 1), (5_000_000_001, len(BOUNDS_NS))],
)
def test_a_value_at_a_bound_is_within_it(value, place):
    tallied = Tallied()
    tallied.add([value])
    assert tallied.histogram().counts.index(1) == place


def test_all_are_counted_and_summed():
    tallied = Tallied()
    assert tallied.histogram() == EMPTY
    tallied.add([1, 2_000_000])
    tallied.add([9_000_000_000])
    assert (sum(tallied.histogram().counts), tallied.histogram().sum) == (3, 9_002_000_001)
