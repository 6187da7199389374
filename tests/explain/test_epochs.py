"""How stamps are read: what unit they are rounded to."""

from itertools import pairwise

import pytest

from syncrelay.explain.epochs import resolution

SECOND = 1_000_000_000


@pytest.mark.parametrize("hz", [3, 10, 200])
@pytest.mark.parametrize("unit", [SECOND, SECOND // 10, SECOND // 100])
def test_coarse_stamps_are_seen_however_often_each_repeats(hz, unit):
    """Not where nearly all periods are the same, which tells nothing, or where there is none."""
    stamps = [(number * SECOND // hz + number % 3 * 7_000_000) // unit * unit for number in range(40)]
    periods = [after - before for before, after in pairwise(stamps) if after != before]
    most = max((periods.count(period) for period in periods), default=0)
    assert resolution(stamps, [0] * 40) == (unit if 0 < most <= 32 else 0)


@pytest.mark.parametrize("hz", [3.25, 9.44])
def test_stamps_that_leap_where_times_of_receipt_do_not_are_rounded(hz):
    true = [round(number * SECOND / hz) for number in range(40)]
    stamps = [at // (SECOND // 10) * (SECOND // 10) for at in true]
    assert resolution(stamps, [at - stamp for at, stamp in zip(true, stamps, strict=True)]) == SECOND // 10


def test_stamps_of_a_regular_sensor_that_leap_where_a_message_was_lost_may_be_exact():
    stamps = [number * SECOND // 10 for number in range(45) if number % 15]
    assert resolution(stamps, [3_000_000] * len(stamps)) == 0
