"""Durations and rates as people write them, to nanoseconds."""

import math
import re
from decimal import Decimal
from fractions import Fraction
from typing import Final

from syncrelay.config.wording import describe, quoted

NS_PER_UNIT: Final = {
    "ns": 1,
    "us": 1_000,
    "µs": 1_000,
    "ms": 1_000_000,
    "s": 1_000_000_000,
    "min": 60_000_000_000,
}
_HERTZ: Final = {"Hz": 1, "hz": 1, "kHz": 1_000}
MAX_NS: Final = 2**63 - 1
# Nothing is sampled more slowly, and a faster clock would leave the relay no time for messages.
_SLOWEST_HZ: Final = Decimal("0.001")
_FASTEST_HZ: Final = 10_000
_FINEST: Final = 10**9
_UNITS = "ns, us, ms, s or min"
# Names of units in other programs.
_MEANT = {
    "nsec": "ns",
    "usec": "us",
    "msec": "ms",
    "millis": "ms",
    "milliseconds": "ms",
    "sec": "s",
    "secs": "s",
    "second": "s",
    "seconds": "s",
    "m": "min",
    "mins": "min",
    "minute": "min",
    "minutes": "min",
}
_QUANTITY = re.compile(r"([+-]?(?:[0-9]{1,40}(?:\.[0-9]{0,40})?|\.[0-9]{1,40})(?:[eE][+-]?[0-9]{1,3})?)\s*([^\W\d_]*)")


def parse_duration(value: object) -> int:
    """Return the nanoseconds of a number of seconds or of a text with a unit, such as 20ms.

    Rounded to the nearest nanosecond. Raises ValueError saying what to write instead.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"expected a duration such as 20ms, found {describe(value)}")  # noqa: TRY004
    if isinstance(value, str):
        number, unit = _number_and_unit(value)
        if not unit:
            raise ValueError(
                f"the string {quoted(value)} has no unit: write {number}ms, or {number} without quotes for seconds"
            )
        return _whole_ns(Decimal(number), _unit_ns(number, unit), found=value)
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"expected a duration such as 20ms, found {describe(value)}")
    # repr gives the digits that were written, where the float itself is a little off.
    return _whole_ns(Decimal(repr(value)), NS_PER_UNIT["s"], found=f"{value} s")


def parse_duration_text(text: str) -> tuple[int, str]:
    """Return the nanoseconds of a text that cannot be a number of seconds, as in a command line, and its unit.

    Raises ValueError as `parse_duration` does.
    """
    number, unit = _number_and_unit(text)
    if not unit:
        raise ValueError(f"{quoted(text)} has no unit, expected one such as `{number}ms`")
    return _whole_ns(Decimal(number), _unit_ns(number, unit), found=text), unit.replace("μ", "µ")


def parse_rate(value: object) -> int:
    """Return the nanoseconds between two events of a rate: a number of them a second, or a text such as 10 Hz.

    Rounded to the nearest nanosecond. Raises ValueError saying what to write instead.
    """
    hertz = _rate_above_0(value)
    period = NS_PER_UNIT["s"] / hertz
    if period < 1:
        raise ValueError(f"{quoted(str(value))} is out of range, at most 1 GHz")
    if period > MAX_NS:
        raise ValueError(f"{quoted(str(value))} is out of range, at least once in 292 years")
    return round(period)


def parse_clock_rate(value: object) -> Fraction:
    """Return the hertz of a rate at which a clock can trigger, exactly as they are written, to a billionth.

    Raises ValueError saying what to write instead.
    """
    hertz = _rate_above_0(value)
    if not _SLOWEST_HZ <= hertz <= _FASTEST_HZ:
        raise ValueError(f"{quoted(str(value))} is out of range, from {_SLOWEST_HZ} Hz to {_FASTEST_HZ // 1000} kHz")
    return Fraction(hertz).limit_denominator(_FINEST)


def _rate_above_0(value: object) -> Decimal:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"expected a rate such as 10 Hz, found {describe(value)}")  # noqa: TRY004
    hertz = _hertz(value) if isinstance(value, str) else Decimal(repr(value))
    if not hertz.is_finite() or hertz <= 0:
        raise ValueError(f"expected a rate above 0, such as 10 Hz, found {describe(value)}")
    return hertz


def _hertz(text: str) -> Decimal:
    number, unit = _number_and_unit(text, expected="a rate such as 10 Hz")
    if not unit:
        raise ValueError(f"the string {quoted(text)} has no unit: write {number} Hz, or {number} without quotes")
    if unit not in _HERTZ:
        raise ValueError(f"unknown unit {quoted(unit)}, expected Hz or kHz")
    return Decimal(number) * _HERTZ[unit]


def _number_and_unit(text: str, *, expected: str = "a duration such as 20ms") -> tuple[str, str]:
    matched = _QUANTITY.fullmatch(text.strip())
    if matched is None:
        raise ValueError(f"expected {expected}, found {describe(text)}")
    number, unit = matched.groups()
    return number, unit


def _unit_ns(number: str, unit: str) -> int:
    """Return the nanoseconds of a unit; raises ValueError saying how the number is written with one that is known."""
    known = NS_PER_UNIT.get(unit.replace("μ", "µ"))
    if known is None:
        lowered = unit.lower()
        meant = lowered if lowered in NS_PER_UNIT else _MEANT.get(lowered)
        hint = f", did you mean `{number}{meant}`?" if meant else f", expected {_UNITS}"
        raise ValueError(f"unknown unit {quoted(unit)}{hint}")
    return known


def _whole_ns(number: Decimal, unit_ns: int, *, found: str) -> int:
    nanoseconds = number * unit_ns
    if abs(nanoseconds) > MAX_NS:
        raise ValueError(f"{quoted(found)} is out of range, at most 292 years")
    return round(nanoseconds)
