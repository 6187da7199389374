"""Figures as people read them."""

from typing import Final

_UNITS: Final = ((1_000_000_000, "s"), (1_000_000, "ms"), (1_000, "us"))
_STEPS: Final = (10, 11, 12, 13, 14, 15, 16, 18, 20, 22, 25, 28, *range(30, 105, 5))
# The longest round one that 64 bits can hold.
_LONGEST: Final = 9_000_000_000 * 1_000_000_000


def duration(nanoseconds: float) -> str:
    """Return a duration with three digits that count, such as 37.2 s, 63 ms, 14 us."""
    for size, unit in _UNITS:
        # What would round up to 1000 of a unit is one of the next.
        if abs(nanoseconds) >= size * 0.9995:
            return f"{_digits(nanoseconds / size)} {unit}"
    return f"{nanoseconds:.0f} ns" if nanoseconds else "0 s"


def seconds(nanoseconds: float) -> str:
    """Return how long something lasts that people watch: 7 s, 3 min, 2.5 h."""
    count = nanoseconds / 1_000_000_000
    if count < 100:  # noqa: PLR2004  two digits are read as they are
        return f"{count:.0f} s" if count >= 9.95 else f"{_digits(round(count, 1))} s"  # noqa: PLR2004
    return f"{count / 60:.0f} min" if count < 6000 else f"{_digits(count / 3600)} h"  # noqa: PLR2004


def span_of_time(nanoseconds: float) -> str:
    """Return a time that may be of any length: 37.2 s, 12 min, 2 h, 3 days, 10 years."""
    days = nanoseconds / 86_400_000_000_000
    if days >= 2 * 365:
        return f"{days / 365.2425:.0f} years"
    if days >= 2:  # noqa: PLR2004  one is still told in hours
        return f"{days:.0f} days"
    return duration(nanoseconds) if nanoseconds < 100_000_000_000 else seconds(nanoseconds)  # noqa: PLR2004


def behind(nanoseconds: int) -> str:
    """Return how far stamps are behind others; ahead of them, where it is less than 0."""
    return f"{span_of_time(abs(nanoseconds))} {'behind' if nanoseconds > 0 else 'ahead of'}"


def earlier(nanoseconds: float) -> str:
    """Return by how much something is earlier than another: `5 ms before`, or `5 ms after` for a negative time."""
    return f"{span_of_time(abs(nanoseconds))} {'before' if nanoseconds > 0 else 'after'}"


def rate(hertz: float) -> str:
    """Return a rate with its unit, such as 19.9 Hz, or 0.00056 Hz."""
    return f"{figure(hertz)} Hz" if hertz >= 0.01 or not hertz else f"{hertz:.2g} Hz"  # noqa: PLR2004  as _digits


def figure(number: float) -> str:
    """Return a number with three digits that count."""
    return _digits(number)


def share(part: float) -> str:
    """Return a share of 1 in percent; neither all nor nothing unless it is."""
    percent = part * 100
    if 0 < percent < 1:
        return "less than 1 %"
    return f"{min(percent, 99) if part < 1 else 100:.0f} %"


def at_least(nanoseconds: int) -> str:
    """Return a duration as it stands in the file: the next round one that is not shorter, such as 75ms.

    Of what no file can hold it is the longest.
    """
    nanoseconds = min(nanoseconds, _LONGEST)
    round_one = 1
    while round_one * 10 < nanoseconds:
        round_one *= 10
    # In tenths, so that 1.2 and 1.5 of a nanosecond are whole numbers too.
    tenths = next(round_one * step for step in _STEPS if round_one * step >= nanoseconds * 10)
    size, unit = next((each for each in _UNITS if tenths >= each[0] * 10), (1, "ns"))
    return f"{_plain(tenths / 10 / size)}{unit}"


def exactly(nanoseconds: int) -> str:
    """Return a duration as it stands in the file, to the millisecond, such as -37200ms or 37.2s."""
    rounded = round(nanoseconds / 1_000_000)
    return f"{_plain(rounded / 1000)}s" if abs(rounded) >= 1000 else f"{rounded}ms"  # noqa: PLR2004


def _plain(number: float) -> str:
    return f"{number:.3f}".rstrip("0").rstrip(".")


def _digits(number: float) -> str:
    magnitude = abs(number)
    decimals = 0 if magnitude >= 99.95 else 1 if magnitude >= 9.995 else 2  # noqa: PLR2004  three digits in all
    return _plain(round(number, decimals))
