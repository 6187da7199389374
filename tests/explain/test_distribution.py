"""Samples: the last values in their order, their quantiles, and how often a value fell below each bound."""

from itertools import pairwise
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.explain import BOUNDS_NS, Distribution
from syncrelay.explain.distribution import NOTHING, Tallied, keep_last, no_values

_BEYOND_64_BITS = st.sampled_from([1 << 70, -(1 << 70)])


@given(st.lists(st.integers(), min_size=1), st.sampled_from([0, 25, 50, 75, 95, 100]))
def test_a_quantile_is_the_least_value_that_so_many_do_not_exceed(values, percent):
    enough = [value for value in values if 100 * sum(each <= value for each in values) >= percent * len(values)]
    assert Distribution(values).quantile(percent / 100) == min(enough)


@given(st.lists(st.integers(-3, 3)), st.integers(-4, 4))
def test_a_share_over_a_limit_is_what_counting_gives(values, limit):
    over = sum(value > limit for value in values)
    assert Distribution(values).share_over(limit) == (over / len(values) if values else 0)


def test_nothing_is_nothing():
    assert not NOTHING
    assert NOTHING.share_over(0) == 0
    with pytest.raises(IndexError):
        NOTHING.quantile(0.5)


@given(st.lists(st.lists(st.one_of(st.integers(0, 10**10), st.sampled_from(BOUNDS_NS)))))
def test_a_histogram_counts_each_value_once_within_the_least_bound_that_is_not_below_it(parts):
    tallied = Tallied()
    for part in parts:
        tallied.add(part)
    values = [value for part in parts for value in part]
    counts = tuple(sum(low < value <= high for value in values) for low, high in pairwise((-1, *BOUNDS_NS, inf)))
    assert (tallied.histogram().counts, tallied.histogram().sum) == (counts, sum(values))


def test_the_bounds_of_a_histogram_rise_from_a_tenth_of_a_millisecond_to_5_s():
    assert (BOUNDS_NS[0], BOUNDS_NS[-1]) == (100_000, 5_000_000_000)
    assert list(BOUNDS_NS) == sorted(set(BOUNDS_NS))


@given(st.lists(st.lists(st.one_of(st.integers(-9, 9), _BEYOND_64_BITS))), st.integers(1, 5))
def test_the_newest_are_kept_in_order_within_64_bits(parts, most):
    values = no_values()
    for part in parts:
        keep_last(values, part, most)
    greatest = (1 << 63) - 1
    near = [max(-greatest, min(greatest, value)) for part in parts for value in part]
    assert values.tolist() == near[-most:]
