"""Quantiles are values that occurred."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.explain import Distribution
from syncrelay.explain.distribution import NOTHING


@pytest.mark.parametrize(
    ("share", "value"), [(0, 10), (0.2, 10), (0.21, 20), (0.5, 30), (0.8, 40), (0.95, 50), (1, 50)]
)
def test_a_quantile_is_the_least_value_that_so_many_do_not_exceed(share, value):
    assert Distribution([50, 30, 10, 40, 20]).quantile(share) == value


@given(st.lists(st.integers(), min_size=1), st.floats(0, 1))
def test_a_quantile_occurred_and_is_not_exceeded_by_more_than_the_rest(values, share):
    sample = Distribution(values)
    quantile = sample.quantile(share)
    assert quantile in values
    assert sample.share_over(quantile) <= 1 - share + 1e-9


@pytest.mark.parametrize(("limit", "share"), [(0, 1), (1, 0.75), (2, 0.25), (3, 0), (9, 0)])
def test_a_share_over_a_limit_leaves_out_what_is_at_it(limit, share):
    assert Distribution([2, 1, 3, 2]).share_over(limit) == share


@given(st.lists(st.integers(-3, 3)), st.integers(-4, 4))
def test_a_share_over_a_limit_is_what_counting_gives(values, limit):
    over = sum(value > limit for value in values)
    assert Distribution(values).share_over(limit) == (over / len(values) if values else 0)


def test_one_in_twenty_is_a_twentieth():
    assert Distribution([0] * 95 + [9] * 5).share_over(1) == 0.05


def test_nothing_is_nothing():
    assert not NOTHING
    assert NOTHING.share_over(0) == 0
    with pytest.raises(IndexError):
        NOTHING.quantile(0.5)
