"""Figures as they are read on the screen."""

import pytest

from syncrelay.top import phrases
from syncrelay.top.pieces import sparkline


@pytest.mark.parametrize(
    ("milliseconds", "text"),
    [
        (None, "-"),
        (0.0, "0 s"),
        (0.518, "518 us"),
        (27.5, "27.5 ms"),
        (-37_200, "-37.2 s"),
        (-99_999_999, "-100000 s"),
        (1_760_000_027_000, "56 years"),
        (-1_760_000_027_000, "-56 years"),
    ],
)
def test_a_duration_fits_its_column(milliseconds, text):
    assert phrases.duration(milliseconds) == text
    assert len(text) <= 9


@pytest.mark.parametrize(
    ("dropped", "text"),
    [({}, "none"), ({"late": 1, "too_far": 66}, "66 too_far, 1 late"), ({"overflow": 3}, "3 overflow")],
)
def test_drops_are_named_the_most_frequent_first(dropped, text):
    assert phrases.drops(dropped) == text


@pytest.mark.parametrize("values", [(-100.0, 0.0, 10.0), (-100.0, 0.0, -10.0)])
def test_a_value_below_zero_is_drawn_as_zero(values):
    assert sparkline(values, 3)[:2] == "▁▁"
