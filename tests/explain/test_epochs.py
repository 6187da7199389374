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
    assert resolution(stamps) == (unit if 0 < most <= 32 else 0)
