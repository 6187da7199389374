"""Quantities counted in buckets that are the same for every recording, so that the counts of many add up."""

from collections import Counter
from collections.abc import Iterable
from typing import Final

# So many binary digits of a number count: a bucket is no wider than an eighth of what is in it.
_DIGITS: Final = 4
_GREATEST: Final = 2**63 - 1


def floor_of(value: int) -> int:
    """Return the floor of a number's bucket, which is the bucket's name: 0 to 15 are their own, then 16, 18, 20 ...

    What is below 0 is in the bucket of its negative, negated.
    """
    magnitude = min(abs(value), _GREATEST)
    shift = max(0, magnitude.bit_length() - _DIGITS)
    floor = magnitude >> shift << shift
    return floor if value >= 0 else -floor


def middle_of(floor: int) -> int:
    """Return the middle of a bucket: no number in it is farther off than a sixteenth."""
    width = 1 << max(0, abs(floor).bit_length() - _DIGITS)
    return floor + (width // 2 if floor >= 0 else -(width // 2))


def counted_in_buckets(values: Iterable[int]) -> dict[int, int]:
    """Return how many numbers each bucket has, by its floor, in the order of the floors."""
    return dict(sorted(Counter(map(floor_of, values)).items()))
