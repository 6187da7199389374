"""Quantities as people read them."""

from typing import Final

_UNITS: Final = (("d", 86_400e9), ("h", 3_600e9), ("min", 60e9), ("s", 1e9), ("ms", 1e6))


def duration(ns: float) -> str:
    """Return a duration in the largest unit of which there is one, to three digits or the tenth of a second."""
    size = abs(ns)
    for unit, length in _UNITS:
        if size >= length:
            count = ns / length
            return f"{count:.{0 if size >= 100 * length else 1}f} {unit}".replace(".0 ", " ")
    return "0 ms" if size < 1e5 else f"{ns / 1e6:.1f} ms"  # noqa: PLR2004  a tenth of a millisecond
