"""The last values of a quantity, beside one another in memory.

Of numbers that lie where they came to be, each copy touches every one, and a look at a group copies thousands: that
cost more than all that is found out from them.
"""

from array import array
from collections.abc import Sequence
from typing import Final

_GREATEST: Final = (1 << 63) - 1


def no_values() -> "array[int]":
    """Make room for values in nanoseconds, oldest first."""
    return array("q")


def keep_last(values: "array[int]", newer: Sequence[int], most: int) -> None:
    """Append newer values and keep so many at most; what 64 bits do not hold is taken for the most that they do."""
    before = len(values)
    try:
        values.extend(newer)
    except OverflowError:
        del values[before:]
        values.extend([max(-_GREATEST, min(_GREATEST, value)) for value in newer])
    del values[:-most]
