from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config.units import parse_duration


@pytest.mark.parametrize(
    ("written", "nanoseconds"),
    [
        (0, 0),
        (-0.0, 0),
        (1, 1_000_000_000),
        (0.02, 20_000_000),
        (0.1 + 0.2, 300_000_000),
        (1e-9, 1),
        (-1.5, -1_500_000_000),
        ("20ms", 20_000_000),
        ("20 ms", 20_000_000),
        (" 20\tms ", 20_000_000),
        ("-12ms", -12_000_000),
        ("+12ms", 12_000_000),
        ("1.5s", 1_500_000_000),
        (".5s", 500_000_000),
        ("2.s", 2_000_000_000),
        ("1e-3s", 1_000_000),
        ("3ns", 3),
        ("7us", 7_000),
        ("7µs", 7_000),
        ("7μs", 7_000),
        ("2min", 120_000_000_000),
        ("0.1ns", 0),
        ("9223372036854775807ns", 2**63 - 1),
        ("-9223372036854775807ns", 1 - 2**63),
        ("0.123456789s", 123_456_789),
    ],
)
def test_a_duration_is_read_exactly(written, nanoseconds):
    assert parse_duration(written) == nanoseconds


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("20", "has no unit: write 20ms, or 20 without quotes for seconds"),
        ("0x10", "unknown unit|expected a duration"),
        ("20 MS", "did you mean `20ms`"),
        ("20 sec", "did you mean `20s`"),
        ("20 parsecs", "unknown unit `parsecs`, expected ns, us, ms, s or min"),
        ("10 Hz", "unknown unit `Hz`"),
        ("1h", "unknown unit `h`"),
        ("20ms 5us", "expected a duration such as 20ms, found the string `20ms 5us`"),
        ("ms", "expected a duration"),
        ("", "expected a duration such as 20ms, found an empty string"),
        ("1e9999s", "expected a duration"),
        ("\u0662\u0660ms", "expected a duration"),
        ("9223372036854775808ns", "out of range, at most 292 years"),
        (10**400, "out of range"),
        (float("nan"), "found the number `nan`"),
        (float("-inf"), "found the number `-inf`"),
        (True, "found `true`"),
        (None, "found nothing"),
        ({"sec": 1}, "found a mapping"),
    ],
)
def test_what_is_no_duration_is_refused_with_what_to_write(written, said):
    with pytest.raises(ValueError, match=said):
        parse_duration(written)


@given(st.integers(-(2**63) + 1, 2**63 - 1))
def test_every_number_of_nanoseconds_can_be_written(nanoseconds):
    assert parse_duration(f"{nanoseconds}ns") == nanoseconds


@given(st.text(max_size=40) | st.floats() | st.integers() | st.none() | st.booleans())
def test_whatever_is_written_is_a_duration_or_a_value_error(written):
    with suppress(ValueError):
        assert abs(parse_duration(written)) < 2**63
