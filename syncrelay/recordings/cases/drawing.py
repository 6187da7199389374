"""A drawn case: what arrives when, and what leaves because of it.

    lidar  |ab.c
    camera |..BC
    -> B: bB, a superseded
    -> C: cC

A column is a period, of stamps and of the clock: messages arrive by column, top row first, each at the moment of its
stamp. Rows of one label are one input: two messages of one stamp need two rows. `arrive: a B b` gives another order of
arrival; the clock then follows the newest column so far. `-> B:` is what leaves when B arrives, `-> @7:` what leaves
by a deadline at column 7. A set is its letters, `-` where an input is missing and
`*` for a message that is not drawn, and `aA stamped A` where it is given
one stamp, that of A; a drop is a letter and its reason. `keys: aA bB` gives letters common keys.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Final, NamedTuple, TypeAlias

from syncrelay.config.wording import did_you_mean, one_of, quoted
from syncrelay.sync import DropReason

_ARROW: Final = "->"
_ARRIVE: Final = "arrive:"
_KEYS: Final = "keys:"
_MOMENT: Final = re.compile(r"@[0-9]{1,9}(\.[0-9]{1,6})?")
_MISSING: Final = "-"
_OTHER: Final = "*"
_REASONS: Final = tuple(reason.value for reason in DropReason)


class Mark(NamedTuple):
    """A message that is drawn: its label, and its column from 0."""

    label: str
    column: int


class Fault(NamedTuple):
    """A problem of a drawing: its line and column from 0, its width, and a sentence."""

    line: int
    column: int
    width: int
    text: str


@dataclass(slots=True)
class Drawing:
    """The content of a drawing: `marks` by letter, and `order` of arrival and `keys` if they are given.

    `expected` are the lines after `->`; `label_lines` has the first line of each label.
    """

    marks: dict[str, Mark] = field(default_factory=dict)
    label_lines: dict[str, int] = field(default_factory=dict)
    width: int = 0
    order: Sequence[str] | None = None
    keys: Mapping[str, str] = field(default_factory=dict)
    expected: list[str] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)

    @property
    def labels(self) -> list[str]:
        """All labels from top to bottom."""
        return list(self.label_lines)


DidYouMean: TypeAlias = Callable[[str, Iterable[str]], str]


def parse(text: str, *, did_you_mean: DidYouMean = did_you_mean) -> Drawing:
    """Read a drawing; problems are in its `faults`."""
    drawing = Drawing()
    others: list[tuple[int, str]] = []
    for number, line in enumerate(text.splitlines()):
        stripped = line.strip()
        if stripped.startswith((_ARROW, _ARRIVE, _KEYS)):
            others.append((number, line))
        elif "|" in stripped:
            drawing.faults += _add_lane(drawing, number, line)
        elif stripped:
            drawing.faults.append(
                _fault(number, line, stripped, "expected a lane such as `lidar |a.bc`, or `-> b: aA`")
            )
    for number, line in others:
        # These lines use letters, which may be drawn below them.
        drawing.faults += _add_line(drawing, number, line, did_you_mean)
    return drawing


def _add_line(drawing: Drawing, number: int, line: str, did_you_mean: DidYouMean) -> Iterator[Fault]:
    """Read a line about the drawn letters: what leaves, their order of arrival, or their keys."""
    stripped = line.strip()
    if stripped.startswith(_ARROW):
        drawing.expected.append(_normal(line))
        yield from _faults_of_line(drawing, number, line, did_you_mean)
        return
    word = _ARRIVE if stripped.startswith(_ARRIVE) else _KEYS
    if drawing.order is not None if word == _ARRIVE else drawing.keys:
        yield _fault(number, line, word, f"there is a `{word}` line above already")
        return
    words = stripped.removeprefix(word).split()
    if word == _ARRIVE:
        drawing.order = words
        if sorted(words) != sorted(drawing.marks):
            text = "expected each drawn letter once, in the order of arrival"
            yield _fault(number, line, stripped, text)
        return
    drawing.keys = {letter: word for word in words for letter in word}
    # A key may contain more than the letters that share it: `a1 A1`.
    of_words = [[letter for letter in word if letter in drawing.marks] for word in words]
    if not words or not all(of_words) or any(count > 1 for count in Counter(chain(*of_words)).values()):
        yield _fault(
            number,
            line,
            stripped,
            "expected the drawn letters that share a key as one word each, such as `keys: aA bB`",
        )


def lanes(text: str) -> list[str]:
    """Return the lines of a drawing that draw messages."""
    return [line.strip() for line in text.splitlines() if line.strip() and not line.strip().startswith(_ARROW)]


def _normal(line: str) -> str:
    moment, _, left = line.strip().removeprefix(_ARROW).partition(":")
    return f"{moment.strip()}: {', '.join(' '.join(each.split()) for each in left.split(','))}"


def _fault(number: int, line: str, token: str, text: str) -> Fault:
    return Fault(number, max(0, line.find(token)), len(token), text)


def _add_lane(drawing: Drawing, number: int, line: str) -> Iterator[Fault]:
    label, _, row = line.partition("|")
    begin = len(label) + 1
    label = label.strip()
    if not label:
        yield Fault(number, begin - 1, 1, "this lane has no name, expected an input such as `lidar |a.bc`")
    drawing.label_lines.setdefault(label, number)
    row = row.rstrip()
    drawing.width = max(drawing.width, len(row))
    for column, letter in enumerate(row):
        if letter == ".":
            continue
        if not letter.isalnum():
            text = f"{quoted(letter)} is not a message, expected a letter or digit, and `.` where nothing comes"
            yield Fault(number, begin + column, 1, text)
        elif letter in drawing.marks:
            yield Fault(number, begin + column, 1, f"`{letter}` is drawn twice: each message needs a letter of its own")
        else:
            drawing.marks[letter] = Mark(label, column)


def _faults_of_line(drawing: Drawing, number: int, line: str, did_you_mean: DidYouMean) -> Iterator[Fault]:
    moment, colon, left = line.strip().removeprefix(_ARROW).partition(":")
    moment = moment.strip()
    if not colon or not moment or not left.strip():
        yield _fault(number, line, line.strip(), "expected what leaves at which message, such as `-> b: aA, c late`")
        return
    if moment not in drawing.marks and not _MOMENT.fullmatch(moment):
        text = f"{quoted(moment)} is not a moment, expected a letter that is drawn, or a column such as `@7`"
        yield _fault(number, line, moment or _ARROW, text)
    for each in left.split(","):
        wrong = _wrong(drawing, each.split(), did_you_mean)
        if wrong:
            yield _fault(number, line, each.strip() or ",", wrong)


def _wrong(drawing: Drawing, words: Sequence[str], did_you_mean: DidYouMean) -> str | None:
    """Return a sentence about what is wrong with a set or a drop, None if nothing is."""
    match words:
        case [letters]:
            return _undrawn(drawing, letters)
        case [letters, "stamped", "tick"]:
            return _undrawn(drawing, letters)
        case [letters, "stamped", stamped]:
            return _undrawn(drawing, letters + stamped)
        case [letter, reason]:
            hint = did_you_mean(reason, _REASONS) or f", expected {one_of(_REASONS)}"
            is_reason = reason in _REASONS
            return _undrawn(drawing, letter) if is_reason else f"{quoted(reason)} is not a reason{hint}"
        case _:
            return "expected a set such as `aA`, or a drop such as `a late`"


def _undrawn(drawing: Drawing, letters: str) -> str | None:
    unknown = [letter for letter in letters if letter not in (_MISSING, _OTHER) and letter not in drawing.marks]
    return f"{quoted(unknown[0])} is not drawn" if unknown else None
