"""Which robot made a recording, by the folders in its path."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Final, Self

from syncrelay.errors import UsageError

_ROBOT: Final = "{robot}"
_TOKENS: Final = re.compile(r"(\{[^{}/]*\}|\*\*|\*|\?)")
_ABSOLUTE: Final = re.compile(r"/|[a-z][a-z0-9+.-]+://", re.IGNORECASE)
_MEANINGS: Final = {_ROBOT: "(?P<robot>[^/]+?)", "**": ".*", "*": "[^/]*", "?": "[^/]"}


@dataclass(frozen=True, slots=True)
class RobotPattern:
    """Where the robot's name is in the path of a recording, such as `{robot}/{day}/*.mcap`."""

    written: str
    _compiled: re.Pattern[str]

    @classmethod
    def parse(cls, written: str) -> Self:
        """Read a pattern for the end of a path, or for a whole path if it begins with `/` or `s3://`.

        `{robot}` and other words in braces stand for the name of a folder or file, or a part of it; `*`, `?` and `**`
        are as in a shell. Raises UsageError unless the robot is there once.
        """
        tokens = _TOKENS.split(written.rstrip("/"))
        if tokens.count(_ROBOT) != 1:
            raise UsageError(f"--robot {written}: expected {_ROBOT} once, as in '{_ROBOT}/{{day}}/*.mcap'")
        begin = "" if _ABSOLUTE.match(written) else "(?:.*/)?"
        return cls(written, re.compile(begin + "".join(map(_regex, tokens)), re.DOTALL))

    def robot_of(self, place: str) -> str | None:
        """Return the robot in a path or URL; None if the pattern does not match."""
        found = self._compiled.fullmatch(place.rstrip("/"))
        return found["robot"] if found else None


def robots_of(places: Sequence[str], pattern: RobotPattern | None) -> list[str | None]:
    """Return the robot of each path or URL.

    Without a pattern it is the first folder in which the paths differ; None for what lies directly in their common one.
    """
    if pattern is not None:
        return [pattern.robot_of(place) for place in places]
    folders = [place.rstrip("/").split("/")[:-1] for place in places]
    common = len([*takewhile(lambda level: len({*level}) == 1, zip(*folders, strict=False))])
    return [each[common] if len(each) > common else None for each in folders]


def _regex(token: str) -> str:
    if token in _MEANINGS:
        return _MEANINGS[token]
    return "[^/]+?" if token.startswith("{") and token.endswith("}") else re.escape(token)
