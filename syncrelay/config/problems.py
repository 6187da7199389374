"""What is wrong with the user's file: where it is, what was found, what was expected, and all of it as text."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final, NamedTuple, TypeAlias

from syncrelay.errors import SyncRelayError
from syncrelay.printable import columns_of, printable

Path: TypeAlias = tuple[str | int, ...]
"""Keys and list indices from the top of the file down to a value."""

_PLAIN_KEY = re.compile(r"[A-Za-z_][\w-]*")
_MOST_SHOWN: Final = 100
# Words for codes that say too little.
_KINDS: Final = {"yaml": "not valid YAML"}
_TAB_WIDTH: Final = 4
# Longer lines are cut around the token.
_LONGEST_LINE: Final = 100
_LEAD: Final = 30
_BOLD, _RED, _BLUE, _RESET = "\033[1m", "\033[31m", "\033[34m", "\033[0m"


class Severity(Enum):
    """The file cannot be used; or it can, but says what is hardly meant; or something in it could not be checked."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


class Span(NamedTuple):
    """A token in the file: line and column from 1, and its width on that line, all in characters.

    `source` tells which file it is, of several that are read together.
    """

    line: int
    column: int
    width: int
    source: int = 0


@dataclass(frozen=True, slots=True)
class Problem:
    """One fault. `span` is None where the file as a whole is meant; `source` is then empty.

    `subject` is the package or type that it is about, empty where it is about the file alone.
    """

    file: str
    path: str
    text: str
    code: str
    span: Span | None = None
    source: str = ""
    severity: Severity = Severity.ERROR
    subject: str = ""


def dotted(path: Path) -> str:
    """`groups.front.topics[1].type`, with keys that are no plain words in quotes."""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
            continue
        text += "." if text else ""
        text += step if _PLAIN_KEY.fullmatch(step) else printable(json.dumps(step, ensure_ascii=False))
    return text


class ConfigError(SyncRelayError):
    """A file that cannot be used, with everything that is wrong with it, in the order of the file."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        super().__init__(problems)
        self.problems = tuple(problems)

    def __str__(self) -> str:
        return render(self.problems)

    @property
    def outline(self) -> str:
        """Return where the errors are and of which kind, as `fusion.yaml:3:5: unknown key`.

        The file may have become a link to one that only the relay may read.
        """
        faults = [each for each in self.problems if each.severity is Severity.ERROR]
        kinds = (_KINDS.get(each.code, each.code.replace("_", " ")) for each in faults)
        lines = [f"{where(each)}: {kind}" for each, kind in zip(faults[:_MOST_SHOWN], kinds, strict=False)]
        unshown = len(faults) - len(lines)
        lines += [f"... and {unshown} more"] if unshown else []
        return "\n".join([*lines, "the relay's log says more, and so does `syncrelay validate`"])


def render(problems: Sequence[Problem], *, colour: bool = False) -> str:
    """Return one block of text per problem, without a newline at the end."""
    blocks = [_block(problem, colour=colour) for problem in problems[:_MOST_SHOWN]]
    unshown = len(problems) - _MOST_SHOWN
    if unshown > 0:
        blocks.append(f"... and {unshown} more")
    return "\n".join(blocks)


def where(problem: Problem) -> str:
    """Return `file:line:column`, or the file alone if it is meant as a whole."""
    file = printable(problem.file)
    if problem.span is None:
        return file
    return f"{file}:{problem.span.line}:{problem.span.column}"


def _block(problem: Problem, *, colour: bool) -> str:
    bold, reset = (_BOLD, _RESET) if colour else ("", "")
    prefix = "" if problem.severity is Severity.ERROR else f"{problem.severity.value}: "
    path = f"{problem.path}: " if problem.path else ""
    head = f"{bold}{where(problem)}:{reset} {prefix}{bold}{path}{reset}{printable(problem.text)}"
    if problem.span is None or not problem.source.strip():
        return head
    return f"{head}\n{_excerpt(problem.source, problem.span, colour=colour)}"


def _excerpt(source: str, span: Span, *, colour: bool) -> str:
    start = span.column - 1
    end = min(start + span.width, len(source))
    first = 0
    if len(source) > _LONGEST_LINE:
        first = max(0, start - _LEAD)
    before = ("…" if first else "") + _shown(source[first:start])
    last = min(len(source), first + _LONGEST_LINE)
    token = _shown(source[start : min(end, last)])
    after = _shown(source[end:last]) + ("…" if last < len(source) else "")
    number = f"{span.line:>5} | "
    gutter = " " * 5 + " | "
    underline = " " * columns_of(before) + "^" * max(1, columns_of(token))
    if colour:
        number, gutter = f"{_BLUE}{number}{_RESET}", f"{_BLUE}{gutter}{_RESET}"
        underline = f"{_RED}{underline}{_RESET}"
    return f"{number}{before}{token}{after}".rstrip() + f"\n{gutter}{underline}"


def _shown(text: str) -> str:
    """Replace what would move the cursor or hide in a terminal, by one character each: `printable` takes several."""
    text = text.replace("\t", " " * _TAB_WIDTH)
    return "".join(each if each.isprintable() else "\N{REPLACEMENT CHARACTER}" for each in text)
