"""How errors speak: the nearest word, what a value is, a list of choices."""

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Final

from syncrelay.printable import printable

LIKENESS: Final = 0.6
"""Words at least this alike, from 0 to 1, are taken for misspellings."""

_LONGEST_QUOTE: Final = 60
_CUT: Final = "…"
# Shorter values are not secrets, and occur in many words.
_SHORTEST_VALUE: Final = 4


@dataclass(frozen=True, slots=True)
class FilledIn:
    """A value with variables, shown as written: the variables may hold secrets."""

    written: str

    def __str__(self) -> str:
        return f"what {quoted(self.written)} stands for"


def without_value(text: str, value: str, written: str) -> str:
    """Replace a variable's value in a text by what is `written` in the file, also where `quoted` cut it off."""
    if len(value) < _SHORTEST_VALUE:
        return text
    text = text.replace(value, written)
    for length in range(min(len(value), _LONGEST_QUOTE), _SHORTEST_VALUE - 1, -1):
        text = text.replace(value[:length] + _CUT, written + _CUT)
    return text


def nearest(word: str, candidates: Iterable[str], *, likeness: float = LIKENESS) -> str | None:
    """Return the candidate most like `word`, ignoring case; None if none reaches `likeness`."""
    by_lower: dict[str, str] = {}
    for candidate in candidates:
        by_lower.setdefault(candidate.lower(), candidate)
    found = get_close_matches(word[:_LONGEST_QUOTE].lower(), by_lower, n=1, cutoff=likeness)
    return by_lower[found[0]] if found else None


def did_you_mean(word: str, candidates: Iterable[str], *, likeness: float = LIKENESS) -> str:
    """Return `, did you mean ...?` for the nearest candidate, or nothing."""
    return or_nearest(nearest(word, candidates, likeness=likeness))


def or_nearest(found: str | None) -> str:
    """Return `, did you mean ...?` for a word that was found, or nothing."""
    return f", did you mean `{found}`?" if found else ""


def quoted(text: str) -> str:
    """Return the text in backticks, or quotes if it has some, on one line and no longer than can be read."""
    # Cut first: a value may be very long and quoted often.
    line = printable(text[: _LONGEST_QUOTE + 1])
    if len(line) > _LONGEST_QUOTE:
        line = line[: _LONGEST_QUOTE - 1] + _CUT
    return f"'{line}'" if "`" in line else f"`{line}`"


def describe(value: object) -> str:
    """Say what a value of the file is: the number `5`, the text `abc`, a list."""
    match value:
        case None:
            return "nothing"
        case bool():
            return f"`{str(value).lower()}`"
        case int() | float():
            return f"the number {quoted(str(value))}"
        case str():
            return f"the string {quoted(value)}" if value else "an empty string"
        case list() | tuple():
            return "a list"
        case _:
            return str(value) if isinstance(value, FilledIn) else "a mapping"


def counted(number: int, word: str) -> str:
    """Return `1 node` or `3 nodes`."""
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


def one_of(words: Iterable[str]) -> str:
    """Return `a`, `a or b`, `a, b or c`."""
    return _listed(words, "or")


def all_of(words: Iterable[str]) -> str:
    """Return `a`, `a and b`, `a, b and c`."""
    return _listed(words, "and")


def _listed(words: Iterable[str], conjunction: str) -> str:
    *first, last = words
    return f"{', '.join(first)} {conjunction} {last}" if first else last
