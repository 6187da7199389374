"""Figures as people read them, and as they stand in the file."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config.units import parse_duration
from syncrelay.explain import words
from tests.explain.support.groups import MS, S

US = 1000
DAY = 86_400 * S

# A duration has three digits; what people watch is in seconds, minutes or hours; a time of any length is read at a
# glance; a share is all or nothing only if it is; what is for the file is round and not shorter, or to the millisecond.
READ: dict[Callable[[Any], str], dict[float, str]] = {
    words.duration: {
        0: "0 s",
        7: "7 ns",
        14 * US: "14 us",
        1234 * US: "1.23 ms",
        63 * MS: "63 ms",
        -12 * MS: "-12 ms",
        37_234 * MS: "37.2 s",
        3600 * S: "3600 s",
    },
    words.seconds: {
        0: "0 s",
        0.44 * S: "0.4 s",
        180 * S: "3 min",
        9000 * S: "2.5 h",
    },
    words.span_of_time: {
        63 * MS: "63 ms",
        37.2 * S: "37.2 s",
        180 * S: "3 min",
        7200 * S: "2 h",
        3 * DAY: "3 days",
        315_964_782 * S: "10 years",
    },
    words.earlier: {5 * MS: "5 ms before", -5 * MS: "5 ms after", -3 * DAY: "3 days after"},
    words.rate: {
        19.94: "19.9 Hz",
        10.0: "10 Hz",
        0.104: "0.1 Hz",
        199.8: "200 Hz",
        9.998: "10 Hz",
        0.000555: "0.00056 Hz",
        0: "0 Hz",
    },
    words.share: {0: "0 %", 0.001: "less than 1 %", 0.05: "5 %", 0.5: "50 %", 0.999: "99 %", 1: "100 %"},
    words.at_least: {
        0: "1ns",
        1: "1ns",
        13 * US + 1: "14us",
        21 * MS: "22ms",
        63 * MS: "65ms",
        100 * MS: "100ms",
        101 * MS: "110ms",
        1 * S: "1s",
        1210 * MS: "1.3s",
        2**63: "9000000000s",
    },
    words.exactly: {37_204_400_000: "37.204s", -12 * MS: "-12ms", 999.6 * MS: "1s", -2 * S: "-2s"},
}


@pytest.mark.parametrize(
    ("read", "figure", "text"), [(read, *each) for read, figures in READ.items() for each in figures.items()]
)
def test_a_figure_is_read_as_it_should_be(read, figure, text):
    assert read(figure) == text


@given(st.integers(1, 10**12))
def test_what_is_written_into_the_file_is_enough_and_no_more_than_a_fifth_too_much(nanoseconds):
    written = parse_duration(words.at_least(nanoseconds))
    assert nanoseconds <= written <= max(nanoseconds * 1.2, nanoseconds + 1)
