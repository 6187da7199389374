"""How long tests of faults and of the C++ peer run: short beside all others, long in `make faults` and `make soak`."""

import os
from typing import TypeVar

_Value = TypeVar("_Value")

IS_LONG = os.environ.get("SYNCRELAY_FAULTS") == "long"


def chosen(*, short: _Value, long: _Value) -> _Value:
    """The value for this run."""
    return long if IS_LONG else short
