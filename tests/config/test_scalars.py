import math
import re
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config.scalars import read_plain

# The core schema of YAML 1.2.2, section 10.3.2. What fits none of these is a text.
_SCHEMA: dict[str, Callable[[str], object]] = {
    "|~|null|Null|NULL": lambda _: None,
    "true|True|TRUE": lambda _: True,
    "false|False|FALSE": lambda _: False,
    "[-+]?[0-9]+": int,
    "0o[0-7]+": lambda text: int(text, 8),
    "0x[0-9a-fA-F]+": lambda text: int(text, 16),
    r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?": float,
    r"[-+]?\.(inf|Inf|INF)": lambda text: float(text.replace(".", "")),
    r"\.(nan|NaN|NAN)": lambda _: math.nan,
}
_ODD = (
    *["nUll", "yes", "NO", "on", "y", "-0x1F", "0b11", "1_000", "12:30:45", "2001-12-14", ".", "inf", "20ms", "١٢"],
    "1\n",
)


@pytest.mark.parametrize("pattern", _SCHEMA)
@given(data=st.data())
def test_a_plain_scalar_is_what_yaml_1_2_says(pattern, data):
    fitting = st.from_regex(pattern, fullmatch=True, alphabet=st.characters(codec="ascii")).filter(
        lambda text: len(text) < 400
    )
    text = data.draw(st.one_of(fitting, st.sampled_from(_ODD), st.text("0189afeExo+-._~:", max_size=6)))
    expected = next((read(text) for each, read in _SCHEMA.items() if re.fullmatch(each, text)), text)
    assert repr(read_plain(text)) == repr(expected)


def test_more_digits_than_any_number_needs_are_a_text():
    assert read_plain("9" * 401) == "9" * 401


@given(st.text(max_size=20))
def test_any_text_is_some_scalar(text):
    read_plain(text)


@given(st.integers(-(10**60), 10**60) | st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_is_read_back(number):
    assert read_plain(repr(number)) == number
