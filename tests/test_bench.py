"""The statistics of `make bench`. Its measurements are not tested here."""

import math
import random
from statistics import median
from typing import NamedTuple

import pytest

from bench.intervals import median_interval, stolen_share, undisturbed
from bench.spent import Thread, by_purpose


# The ranks are from tables of confidence intervals for a median.
@pytest.mark.parametrize(("n", "low", "high"), [(6, 1, 6), (9, 2, 8), (10, 2, 9), (25, 8, 18), (60, 22, 39)])
def test_the_interval_of_a_median_is_between_two_of_its_values(n, low, high):
    values = list(range(1, n + 1))
    random.Random(n).shuffle(values)
    assert median_interval(values) == (low, median(values), high)


def test_a_ratio_is_above_a_bound_if_its_whole_interval_is():
    assert median_interval([1.11] * 6 + [1.2] * 6).is_above(1.1)
    assert not median_interval([1.09] * 3 + [1.2] * 9).is_above(1.2)
    assert not median_interval([1.09] * 4 + [1.2] * 5).is_above(1.1)
    # Too few rounds tell nothing.
    assert not median_interval([3.0] * 5).is_above(1.1)


def test_five_values_or_fewer_give_no_interval_however_alike_they_are():
    assert median_interval([1.0] * 5) == (-math.inf, 1.0, math.inf)
    assert median_interval([1.0] * 6).width == 0


def test_the_interval_holds_the_true_median_in_95_of_100_series_of_rounds_with_outliers():
    draw = random.Random(17)
    series = [[draw.gauss(1, 0.05) + draw.choice((0, 0, 0, 0, 1, -1)) * 0.5 for _ in range(20)] for _ in range(2000)]
    held = sum(low <= 1 <= high for low, _, high in map(median_interval, series))
    assert held / len(series) >= 0.95


class Round(NamedTuple):
    stolen: float


def test_a_round_of_which_more_than_a_twentieth_was_stolen_is_dropped():
    assert undisturbed([Round(0), Round(0.051), Round(0.05), Round(1)]) == [Round(0), Round(0.05)]


def test_stolen_is_a_share_of_all_time_that_passed():
    before = "cpu  100 10 50 1000 5 1 2 30 7 0\n"
    after = "cpu  150 10 60 1020 5 1 4 48 7 0\n"
    assert stolen_share(before, after) == 18 / 100
    assert stolen_share(before, before) == 0


def test_the_thread_that_takes_messages_is_the_busiest_that_dds_did_not_start():
    listener, events, writer = Thread(3, "dds.shm.7411"), Thread(4, "dds.ev.0"), Thread(5, "dds.asyn.0")
    main, other, idle = Thread(1, "python"), Thread(2, "python"), Thread(6, "python")
    dds = {listener: 900, events: 30, writer: 2}
    in_c = {"receive": 100, "DDS listener": 900, "dds.ev": 30, "main": 0, "other": 2}
    assert by_purpose({main: 100, **dds}, pid=1) == in_c
    assert by_purpose({main: 4, other: 100, idle: 1, **dds}, pid=1) == {**in_c, "main": 4, "other": 3}
