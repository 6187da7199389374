"""Limits of the rules: draws in which what is said becomes another while one number goes from what it is to another.

Of what is near to a limit, nothing but the limit itself tells which side of it is which. Where limits are is found by
bisection, once; limits.txt holds the last number before each, so that what is said on either side is all that is left
to look at. Of the many that are found, those are kept that show another condition of the code, or by another number.
"""

import hashlib
import random
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from math import nextafter
from pathlib import Path
from types import CodeType
from typing import Any, Final, NamedTuple

from tests.bank.any_facts import dial_of_facts, dial_of_looks
from tests.bank.any_rigs import dial_of_input, dial_of_rig
from tests.bank.any_trials import dial_of_trials
from tests.bank.dials import Dial

LIMITS: Final = Path(__file__).with_name("limits.txt")
"""A line a limit: what is drawn, by which seed, the number, the last before the limit, a digest of both sides."""

# Where there is none of what was counted, something else is said.
_FIGURE: Final = re.compile(r"-?(?=[\d.]*[1-9])\d[\d.e-]* ?\w*")
_DRAWN: Final[dict[str, Callable[[random.Random], Dial | None]]] = {
    "facts": dial_of_facts,
    "looks": dial_of_looks,
    "input": dial_of_input,
    "rig": dial_of_rig,
    "trials": dial_of_trials,
}
# From so many draws: minutes in all.
_DRAWS: Final = {"facts": 45_000, "looks": 1_500, "input": 400, "rig": 60, "trials": 200}
# Of one condition so many are kept, and so many that are shown by one number.
_OF_CONDITION: Final = 20
_BY_NUMBER: Final = 3


class Limit(NamedTuple):
    """Where what is said of a draw becomes another."""

    drawn: str
    seed: int
    what: str
    last: int | float

    @classmethod
    def of(cls, line: str) -> "Limit":
        """Return that of a line of the file."""
        drawn, seed, what, last, _ = line.split()
        return cls(drawn, int(seed), what, float(last) if "." in last or "e" in last else int(last))

    def line(self) -> str:
        """Return a line of the file: what is said on either side."""
        dial = dialled(self.drawn, self.seed)
        if dial is None or dial.what != self.what:
            return f"{self.drawn} {self.seed} is another draw"
        said = "\n".join(map(dial.said, self.sides(dial)))
        digest = hashlib.sha256(said.encode()).hexdigest()[:8]
        return f"{self.drawn} {self.seed} {self.what} {self.last!r} {digest}"

    def sides(self, dial: Dial) -> tuple[Any, Any]:
        """Return the last number before it, and the first beyond."""
        if isinstance(self.last, float):
            return self.last, nextafter(self.last, dial.high)
        return self.last, self.last + (1 if dial.high > dial.low else -1)


def dialled(drawn: str, seed: int) -> Dial | None:
    """Return what a seed draws."""
    return _DRAWN[drawn](random.Random(f"{drawn} {seed}"))


def known_limits() -> Iterator[Limit]:
    """Yield those of the file, where they are by now."""
    for each in map(Limit.of, LIMITS.read_text().splitlines()):
        yield from _limit(each.drawn, each.seed)


def drawn_limits() -> Iterator[Limit]:
    """Yield limits of new draws: of each condition of the code some. It takes Python 3.12."""
    of_condition, by_number = Counter[object](), Counter[object]()
    for drawn, count in _DRAWS.items():
        for limit in (each for seed in range(count) for each in _limit(drawn, seed)):
            dial = dialled(drawn, limit.seed)
            assert dial is not None
            condition = _condition(*(_branches(dial.said, each) for each in limit.sides(dial)))
            by = condition, drawn, limit.what
            if of_condition[condition] < _OF_CONDITION and by_number[by] < _BY_NUMBER:
                of_condition[condition] += 1
                by_number[by] += 1
                yield limit


def _limit(drawn: str, seed: int) -> Iterator[Limit]:
    """Yield the limit of a draw, if it has one."""
    if (dial := dialled(drawn, seed)) is None:
        return
    low, high = dial.low, dial.high
    words = _without_figures(dial.said(low))
    if words == _without_figures(dial.said(high)):
        return
    while (middle := (low + high) / 2 if isinstance(low + high, float) else (low + high) // 2) not in (low, high):
        if _without_figures(dial.said(middle)) == words:
            low = middle
        else:
            high = middle
    yield Limit(drawn, seed, dial.what, low)


def _without_figures(text: str) -> str:
    return _FIGURE.sub("", text)


def _branches(said: Callable[[Any], str], number: Any) -> list[tuple[CodeType, int, int]]:
    """Return which way each condition of explain went, in order."""
    taken = list[tuple[CodeType, int, int]]()
    # Python 3.11, on which tests run too, has none.
    seen: Any = vars(sys)["monitoring"]

    def note(code: CodeType, at: int, to: int) -> object:
        if "/syncrelay/explain/" not in code.co_filename:
            return seen.DISABLE
        taken.append((code, at, to))
        return None

    seen.use_tool_id(seen.COVERAGE_ID, "limits")
    seen.register_callback(seen.COVERAGE_ID, seen.events.BRANCH, note)
    seen.set_events(seen.COVERAGE_ID, seen.events.BRANCH)
    try:
        said(number)
    finally:
        seen.set_events(seen.COVERAGE_ID, 0)
        seen.free_tool_id(seen.COVERAGE_ID)
    return taken


def _condition(one: list[tuple[CodeType, int, int]], other: list[tuple[CodeType, int, int]]) -> object:
    """Return the first condition that went another way."""
    pairs = zip(one, other, strict=False)
    code, at, _ = next((first for first, second in pairs if first != second), (None, 0, 0))
    return code and (code.co_filename, code.co_qualname, at)
