"""What a number shall be, as people write it: `980`, `">= 980"`, `"< 20ms"`, `">= 98%"`."""

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Decimal
from enum import Enum
from types import MappingProxyType
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, InstanceOf, WithJsonSchema

from syncrelay.config.units import parse_duration
from syncrelay.config.wording import describe, quoted

_WRITTEN: Final = re.compile(r"\s*(<=|>=|==|<|>|=)?\s*(.*?)\s*", re.DOTALL)
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
_MS: Final = 1_000_000
# So many digits of a share are told, and those of a duration in milliseconds.
_DIGITS: Final = Decimal("0.0001")


class Quantity(Enum):
    """What is bounded: how many, which share of all, how long in nanoseconds."""

    COUNT = 'a count such as 980 or ">= 980"'
    SHARE = 'a share such as ">= 0.98" or ">= 98%"'
    DURATION = 'a duration such as "< 20ms"'


@dataclass(frozen=True, slots=True)
class Bound:
    """A number and how what is found shall compare to it; an empty `comparison` is equality."""

    quantity: Quantity
    comparison: str
    value: Decimal

    def holds(self, found: Decimal) -> bool:
        """Tell whether what was found is as it shall be. Of a share, so many digits are equal as are told."""
        if self.quantity is Quantity.SHARE and _COMPARE[self.comparison] is operator.eq:
            return found.quantize(_DIGITS) == self.value.quantize(_DIGITS)
        return _COMPARE[self.comparison](found, self.value)

    def __str__(self) -> str:
        return f"{self.comparison} {told(self.quantity, self.value)}".strip()

    def told(self, found: Decimal) -> str:
        """Return what was found as a file would have it, rounded so that it is seen to differ."""
        return told(self.quantity, found, {"<": "<=", ">": ">="}.get(self.comparison, self.comparison))

    def renewed(self, found: Decimal) -> str | int:
        """Return how a file says that what was found is as it shall be, compared as before."""
        comparison = {"<": "<=", ">": ">="}.get(self.comparison, self.comparison)
        text = told(self.quantity, found, comparison)
        if comparison:
            return f"{comparison} {text}"
        return int(found) if self.quantity is Quantity.COUNT else text


def told(quantity: Quantity, number: Decimal, comparison: str = "") -> str:
    """Return a number as a file would have it; rounded so that it compares so to what it was."""
    rounding = {"<=": ROUND_CEILING, ">=": ROUND_FLOOR}.get(comparison, ROUND_HALF_EVEN)
    match quantity:
        case Quantity.COUNT:
            return str(int(number))
        case Quantity.SHARE:
            return f"{number.quantize(_DIGITS, rounding).normalize():f}"
        case Quantity.DURATION:
            # Alone, it is compared to the nanosecond.
            exact = number / _MS
            return f"{(exact.quantize(_DIGITS, rounding) if comparison else exact).normalize():f}ms"


def _bound(quantity: Quantity) -> Callable[[object], Bound]:
    def parse(value: object) -> Bound:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(f"expected {quantity.value}, found {describe(value)}")  # noqa: TRY004
        if isinstance(value, float | int) and quantity is Quantity.DURATION:
            return Bound(quantity, "", Decimal(parse_duration(value)))
        matched = _WRITTEN.fullmatch(value if isinstance(value, str) else repr(value))
        assert matched is not None  # noqa: S101  it matches anything
        return Bound(quantity, matched[1] or "", _number(quantity, matched[2], value))

    return parse


def _number(quantity: Quantity, text: str, value: object) -> Decimal:
    if quantity is Quantity.DURATION:
        number = parse_duration(text)
        if number < 0:
            raise ValueError(f"expected a duration of 0 or more, found {quoted(text)}")
        return Decimal(number)
    if quantity is Quantity.COUNT and _COUNT.fullmatch(text):
        return Decimal(text)
    share = _SHARE.fullmatch(text)
    if quantity is Quantity.SHARE and share is not None:
        number_of = Decimal(share[1]) / (100 if share[2] else 1)
        if number_of <= 1:
            return number_of
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
    _schema(number="number", text=r"[0-9.eE+]+\s*(ns|us|µs|μs|ms|s|min)\s*$"),
]
"""A bound of a duration."""
