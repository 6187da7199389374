"""Figures as people read them, and as they stand in the file."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config.units import parse_duration
from syncrelay.explain import words
from tests.explain.support.groups import MS, S

US = 1000


@pytest.mark.parametrize(
    ("nanoseconds", "text"),
    [
        (0, "0 s"),
        (7, "7 ns"),
        (999, "999 ns"),
        (999.6, "1 us"),
        (14 * US, "14 us"),
        (1234 * US, "1.23 ms"),
        (63 * MS, "63 ms"),
        (999.6 * MS, "1 s"),
        (-12 * MS, "-12 ms"),
        (37_234 * MS, "37.2 s"),
        (3600 * S, "3600 s"),
    ],
)
def test_a_duration_has_three_digits(nanoseconds, text):
    assert words.duration(nanoseconds) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "0 s"),
        (0.44, "0.4 s"),
        (5.02, "5 s"),
        (9.96, "10 s"),
        (99.4, "99 s"),
        (180, "3 min"),
        (5990, "100 min"),
        (9000, "2.5 h"),
    ],
)
def test_what_people_watch_is_in_seconds_minutes_or_hours(seconds, text):
    assert words.seconds(seconds * S) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.063, "63 ms"),
        (37.2, "37.2 s"),
        (180, "3 min"),
        (7200, "2 h"),
        (3 * 86_400, "3 days"),
        (315_964_782, "10 years"),
    ],
)
def test_a_time_of_any_length_is_read_at_a_glance(seconds, text):
    assert words.span_of_time(seconds * S) == text


@pytest.mark.parametrize(
    ("hertz", "text"), [(19.94, "19.9 Hz"), (10.0, "10 Hz"), (0.104, "0.1 Hz"), (199.8, "200 Hz"), (9.998, "10 Hz")]
)
def test_a_rate_has_three_digits(hertz, text):
    assert words.rate(hertz) == text


@pytest.mark.parametrize(
    ("part", "text"),
    [(0, "0 %"), (0.001, "less than 1 %"), (0.05, "5 %"), (0.5, "50 %"), (0.999, "99 %"), (1, "100 %")],
)
def test_a_share_is_all_or_nothing_only_if_it_is(part, text):
    assert words.share(part) == text


@pytest.mark.parametrize(
    ("nanoseconds", "text"),
    [
        (0, "1ns"),
        (1, "1ns"),
        (13 * US + 1, "14us"),
        (21 * MS, "22ms"),
        (63 * MS, "65ms"),
        (100 * MS, "100ms"),
        (101 * MS, "110ms"),
        (1 * S, "1s"),
        (1210 * MS, "1.3s"),
    ],
)
def test_a_duration_for_the_file_is_round_and_not_shorter(nanoseconds, text):
    assert words.at_least(nanoseconds) == text


@given(st.integers(1, 10**12))
def test_what_is_written_into_the_file_is_enough_and_no_more_than_a_fifth_too_much(nanoseconds):
    written = parse_duration(words.at_least(nanoseconds))
    assert nanoseconds <= written <= max(nanoseconds * 1.2, nanoseconds + 1)


@pytest.mark.parametrize(
    ("nanoseconds", "text"), [(37_204_400_000, "37.204s"), (-12 * MS, "-12ms"), (999.6 * MS, "1s"), (-2 * S, "-2s")]
)
def test_an_offset_for_the_file_is_to_the_millisecond(nanoseconds, text):
    assert words.exactly(nanoseconds) == text
