"""Which robot made a recording, by the folders that it lies in."""

import re
from dataclasses import dataclass
from itertools import takewhile
from typing import Final, Self

from syncrelay.errors import UsageError

_ROBOT: Final = "{robot}"
_TOKENS: Final = re.compile(r"(\{[^{}/]*\}|\*\*|\*|\?)")
_ABSOLUTE: Final = re.compile(r"/|[a-z][a-z0-9+.-]+://", re.IGNORECASE)
_MEANINGS: Final = {"**": ".*", "*": "[^/]*", "?": "[^/]"}


@dataclass(frozen=True, slots=True)
class RobotPattern:
    """Where in the path of a recording its robot stands, such as `{robot}/{day}/*.mcap`."""

    written: str
    _compiled: re.Pattern[str]

    @classmethod
    def parse(cls, written: str) -> Self:
        """Read a pattern for the end of a path, or for all of one that begins with `/` or `s3://`.

        `{robot}` is a folder's or file's name, or a part of it, as any other word in braces is; `*`, `?` and `**` are
        as a shell has them. Raises UsageError where the robot is missing, or there twice.
        """
        tokens = _TOKENS.split(written.rstrip("/"))
        if tokens.count(_ROBOT) != 1:
            raise UsageError(f"--robot {written}: expected {_ROBOT} once, as in '{_ROBOT}/{{day}}/*.mcap'")
        begin = "" if _ABSOLUTE.match(written) else "(?:.*/)?"
        return cls(written, re.compile(begin + "".join(map(_regex, tokens)), re.DOTALL))

    def robot_of(self, place: str) -> str | None:
        """Return the robot that a path or URL names; None where it does not fit the pattern."""
        found = self._compiled.fullmatch(place.rstrip("/"))
        return found["robot"] if found else None


def _regex(token: str) -> str:
    if token == _ROBOT:
        return "(?P<robot>[^/]+?)"
    if token.startswith("{") and token.endswith("}"):
        return "[^/]+?"
    return _MEANINGS.get(token) or re.escape(token)


def folders_of(place: str) -> tuple[str, ...]:
    """Return the names of the folders that a path or URL lies in."""
    return tuple(place.rstrip("/").split("/")[:-1])


def common_folders(one: tuple[str, ...], other: tuple[str, ...]) -> tuple[str, ...]:
    """Return the folders that both lie in."""
    same = takewhile(lambda pair: pair[0] == pair[1], zip(one, other, strict=False))
    return tuple(folder for folder, _ in same)


def folder_below(common: tuple[str, ...], folders: tuple[str, ...]) -> str | None:
    """Return the first folder below the common ones; None for what lies in these themselves."""
    return folders[len(common)] if len(folders) > len(common) else None
