import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config.scalars import read_plain


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", None),
        ("~", None),
        ("null", None),
        ("NULL", None),
        ("nUll", "nUll"),
        ("true", True),
        ("False", False),
        ("tRUE", "tRUE"),
        ("yes", "yes"),
        ("NO", "NO"),
        ("on", "on"),
        ("y", "y"),
        ("0", 0),
        ("-12", -12),
        ("+12", 12),
        ("0777", 777),
        ("0o17", 15),
        ("0x1F", 31),
        ("-0x1F", "-0x1F"),
        ("0b11", "0b11"),
        ("1_000", "1_000"),
        ("12:30:45", "12:30:45"),
        ("1e-3", 0.001),
        ("1.", 1.0),
        (".5", 0.5),
        ("-.5e+2", -50.0),
        ("1e3", 1000.0),
        (".", "."),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("inf", "inf"),
        ("nan", "nan"),
        ("2001-12-14", "2001-12-14"),
        ("=", "="),
        ("20ms", "20ms"),
        ("١٢", "١٢"),
        ("9" * 401, "9" * 401),
    ],
)
def test_a_plain_scalar_is_what_yaml_1_2_says(text, value):
    read = read_plain(text)
    assert (type(read), read) == (type(value), value)


@pytest.mark.parametrize("text", [".nan", ".NaN", ".NAN"])
def test_not_a_number_is_a_number(text):
    read = read_plain(text)
    assert isinstance(read, float)
    assert math.isnan(read)


@given(st.text(max_size=20))
def test_any_text_is_some_scalar(text):
    read_plain(text)


@given(st.integers(-(10**60), 10**60))
def test_an_integer_is_read_back(number):
    assert read_plain(str(number)) == number


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_float_is_read_back(number):
    assert read_plain(repr(number)) == number
