from contextlib import suppress
from decimal import Decimal
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config.units import parse_duration

_NS = {"ns": 1, "us": 1_000, "µs": 1_000, "μs": 1_000, "ms": 1_000_000, "s": 10**9, "min": 60 * 10**9}
_NUMBERS = st.from_regex(r"[+-]?([0-9]{1,6}\.?|[0-9]{0,6}\.[0-9]{1,6})(e[+-]?[0-2])?", fullmatch=True)


@given(_NUMBERS, st.sampled_from(["", " ", "\t", "  "]))
def test_a_duration_is_the_nearest_nanosecond_to_what_is_written(number, space):
    written = Fraction(Decimal(number))
    for unit, each in _NS.items():
        assert abs(parse_duration(f"{space}{number}{space}{unit}{space}") - written * each) <= Fraction(1, 2)
    assert abs(parse_duration(float(number)) - written * _NS["s"]) <= Fraction(1, 2)
    assert parse_duration(int(written)) == int(written) * _NS["s"]


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("20", "has no unit: write 20ms, or 20 without quotes for seconds"),
        ("0x10", "unknown unit|expected a duration"),
        ("20 MS", "did you mean `20ms`"),
        ("20 parsecs", "unknown unit `parsecs`, expected ns, us, ms, s or min"),
        ("20ms 5us", "expected a duration such as 20ms, found the string `20ms 5us`"),
        ("", "expected a duration such as 20ms, found an empty string"),
        ("1e9999s", "expected a duration"),
        ("\u0662\u0660ms", "expected a duration"),
        ("9223372036854775808ns", "out of range, at most 292 years"),
        (10**400, "out of range"),
        (float("nan"), "found the number `nan`"),
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
