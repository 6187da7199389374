"""A fault in the user's file: where it stands, what was found, what was expected."""

import json
import re
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, TypeAlias

from syncrelay.config.wording import printable

Path: TypeAlias = tuple[str | int, ...]
"""Keys and list indices from the top of the file down to a value."""

_PLAIN_KEY = re.compile(r"[A-Za-z_][\w-]*")


class Severity(Enum):
    """An error refuses the file; a note says what could not be checked, or is hardly meant."""

    ERROR = "error"
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
    """One fault. `span` is None where the file as a whole is meant; `source` is then empty."""

    file: str
    path: str
    text: str
    code: str
    span: Span | None = None
    source: str = ""
    severity: Severity = Severity.ERROR


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
