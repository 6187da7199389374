"""Bounds of an expected number, as people write them: `980`, `">= 980"`, `"< 20ms"`, `">= 98%"`."""

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Decimal
from enum import Enum
from types import MappingProxyType
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, InstanceOf, WithJsonSchema

from syncrelay.config.units import NS_PER_UNIT, parse_duration, parse_duration_text
from syncrelay.config.wording import describe

_WRITTEN: Final = re.compile(r"\s*(<=|>=|==|<|>|=)?\s*(.*?)\s*", re.DOTALL)
_BEGINS_NUMBER: Final = tuple("+-.0123456789")
_COUNT: Final = re.compile("[0-9]{1,15}")
_SHARE: Final = re.compile(r"([0-9]{1,3}(?:\.[0-9]{0,9})?|\.[0-9]{1,9})\s*(%?)")
_COMPARE: Final[Mapping[str, Callable[[Any, Any], bool]]] = MappingProxyType(
    {
        "": operator.eq,
        "=": operator.eq,
        "==": operator.eq,
        "<": operator.lt,
        "<=": operator.le,
        ">": operator.gt,
        ">=": operator.ge,
    }
)
_WHOLE: Final = Decimal(1)
# Shares, and durations in their unit, are printed with four decimals.
_DIGITS: Final = Decimal("0.0001")
_ROUNDED: Final[Mapping[str, str]] = MappingProxyType(
    {"<": ROUND_CEILING, "<=": ROUND_CEILING, ">": ROUND_FLOOR, ">=": ROUND_FLOOR}
)
_SIZES: Final[Mapping[str, Decimal]] = MappingProxyType(
    {"": Decimal(1), "%": Decimal("0.01"), **{unit: Decimal(size) for unit, size in NS_PER_UNIT.items()}}
)
# A duration that is far shorter than the unit of the file is printed in the first of these that is no longer than it.
_UNITS: Final = ("s", "ms", "us", "ns")
_FAR_SHORTER: Final = Decimal("0.1")


class Quantity(Enum):
    """What is bounded: how many, which share of all, how long in nanoseconds."""

    COUNT = 'a count such as 980 or ">= 980"'
    SHARE = 'a share such as ">= 0.98" or ">= 98%"'
    DURATION = 'a duration such as "< 20ms"'


@dataclass(frozen=True, slots=True)
class Bound:
    """A number, and how a measured value must compare to it; an empty `comparison` is equality.

    `unit` is as written in the file: `%` or nothing for a share, one of NS_PER_UNIT for a duration.
    """

    quantity: Quantity
    comparison: str
    value: Decimal
    unit: str = ""

    def holds(self, found: Decimal) -> bool:
        """Return whether a measured value is within the bound. Shares are compared with the digits that are printed."""
        if self.quantity is Quantity.SHARE and _COMPARE[self.comparison] is operator.eq:
            return _share(found) == _share(self.value)
        return _COMPARE[self.comparison](found, self.value)

    def __str__(self) -> str:
        return f"{self.comparison} {_written(self.value, self.unit)}".strip()

    def told(self, found: Decimal) -> str:
        """Write a measured value as in a file, rounded so that its difference from the bound shows."""
        rounding = _ROUNDED.get(self.comparison)
        if self.quantity is Quantity.SHARE and rounding is None:
            return _written(_share(found), self.unit)
        unit, step = self.unit, _DIGITS
        if self.quantity is Quantity.DURATION:
            unit = _fitting(self.unit, found)
            # Equality is compared to the nanosecond.
            step = Decimal(1) if rounding is None else _DIGITS * _SIZES[unit]
        return _written((found / step).to_integral_value(rounding or ROUND_HALF_EVEN) * step, unit)


def _written(number: Decimal, unit: str) -> str:
    return f"{(number / _SIZES[unit]).normalize():f}{unit}"


def _share(number: Decimal) -> Decimal:
    """Round a share to the digits that are printed, but never to 0 or 1: 19,999 of 20,000 messages are not all."""
    rounded = number.quantize(_DIGITS)
    if rounded == _WHOLE and number < _WHOLE:
        return rounded - _DIGITS
    return _DIGITS if not rounded and number else rounded


def _fitting(unit: str, nanoseconds: Decimal) -> str:
    if not nanoseconds or nanoseconds >= NS_PER_UNIT[unit] * _FAR_SHORTER:
        return unit
    return next((each for each in _UNITS if nanoseconds >= NS_PER_UNIT[each]), _UNITS[-1])


def _bound(quantity: Quantity) -> Callable[[object], Bound]:
    def parse(value: object) -> Bound:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(f"expected {quantity.value}, found {describe(value)}")  # noqa: TRY004
        if isinstance(value, float | int) and quantity is Quantity.DURATION:
            return Bound(quantity, "", _not_negative(parse_duration(value), value), "ms")
        matched = _WRITTEN.fullmatch(value if isinstance(value, str) else repr(value))
        assert matched is not None  # noqa: S101  it matches anything
        comparison = matched[1] or ""
        if quantity is Quantity.DURATION:
            return _able_to_fail(Bound(quantity, comparison, *_duration(comparison, matched[2], value)))
        return _able_to_fail(Bound(quantity, comparison, *_number(quantity, matched[2], value)))

    return parse


def _able_to_fail(bound: Bound) -> Bound:
    """Refuse a bound that holds for the least, the greatest and its own value, or for none of them."""
    greatest = _WHOLE if bound.quantity is Quantity.SHARE else Decimal("Infinity")
    held = [_COMPARE[bound.comparison](value, bound.value) for value in (Decimal(0), bound.value, greatest)]
    if all(held):
        raise ValueError(f"`{bound}` holds whatever is found, so it tests nothing")
    if not any(held):
        raise ValueError(f"`{bound}` never holds, whatever is found")
    return bound


def _duration(comparison: str, text: str, value: object) -> tuple[Decimal, str]:
    if not text.startswith(_BEGINS_NUMBER):
        raise ValueError(f"expected {Quantity.DURATION.value}, found {describe(value)}")
    if not comparison:
        # Raises the error for a missing unit.
        parse_duration(text)
    number, unit = parse_duration_text(text)
    return _not_negative(number, value), unit


def _not_negative(nanoseconds: int, value: object) -> Decimal:
    if nanoseconds < 0:
        raise ValueError(f"expected a duration of 0 or more, found {describe(value)}")
    return Decimal(nanoseconds)


def _number(quantity: Quantity, text: str, value: object) -> tuple[Decimal, str]:
    if quantity is Quantity.COUNT and _COUNT.fullmatch(text):
        return Decimal(text), ""
    share = _SHARE.fullmatch(text)
    if quantity is Quantity.SHARE and share is not None:
        number_of = Decimal(share[1]) / (100 if share[2] else 1)
        if number_of <= 1:
            return number_of, share[2]
    raise ValueError(f"expected {quantity.value}, found {describe(value)}")


def _schema(*, number: str, text: str) -> WithJsonSchema:
    compared = r"^\s*(<=|>=|==|<|>|=)?\s*"
    return WithJsonSchema({"anyOf": [{"type": number, "minimum": 0}, {"type": "string", "pattern": compared + text}]})


Count = Annotated[
    InstanceOf[Bound], BeforeValidator(_bound(Quantity.COUNT)), _schema(number="integer", text=r"[0-9]+\s*$")
]
"""A bound of a whole number."""

Share = Annotated[
    InstanceOf[Bound], BeforeValidator(_bound(Quantity.SHARE)), _schema(number="number", text=r"[0-9.]+\s*%?\s*$")
]
"""A bound of a share, 0 to 1 or 0% to 100%."""

Time = Annotated[
    InstanceOf[Bound],
    BeforeValidator(_bound(Quantity.DURATION)),
    _schema(number="number", text=r"[0-9.eE+-]+\s*(ns|us|µs|μs|ms|s|min)\s*$"),
]
"""A bound of a duration."""
