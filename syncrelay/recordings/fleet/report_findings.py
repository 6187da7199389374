"""What was found in many recordings, each finding with the values that were suggested where it was found."""

from dataclasses import dataclass, field
from typing import Final, Self

from syncrelay.recordings.fleet.cells import Cells
from syncrelay.recordings.fleet.documents import Finding, Group
from syncrelay.recordings.fleet.suggestions import Gain, Suggested, Values, Where, values_of

SEVERITIES: Final = ("ok", "warn", "error")
"""The better first."""


@dataclass(frozen=True, slots=True)
class Found:
    """A finding of so many recordings, the sentences of the one in which it lasted longest, and what would help.

    `values` were suggested for some of these recordings; `gain` is of all that any were suggested for.
    """

    where: Where
    code: str
    severity: str
    recordings: int
    seconds: int
    text: str
    advice: str
    example: str
    values: tuple[Suggested, ...]
    gain: Gain


@dataclass(frozen=True, slots=True, order=True)
class _Example:
    """Ordered by how long it lasted."""

    seconds: int
    recording: str
    text: str
    advice: str


@dataclass(slots=True)
class _Tallied:
    recordings: int = 0
    seconds: int = 0
    severity: int = 0
    example: _Example = field(default_factory=lambda: _Example(-1, "", "", ""))
    values: Values = field(default_factory=Values)

    def add(self, other: Self) -> None:
        self.recordings += other.recordings
        self.seconds += other.seconds
        self.severity = max(self.severity, other.severity)
        self.example = max(self.example, other.example)
        self.values.add(other.values)


class Findings:
    """The findings of recordings, as they come."""

    def __init__(self) -> None:
        self._found: Cells[tuple[Where, str], _Tallied] = Cells(_Tallied)

    def count(self, recording: str, group: Group) -> None:
        """Count what was found of a group in a recording."""
        values = values_of(group)
        for finding in {(each.input, each.code): each for each in group.findings}.values():
            tallied = _tallied(recording, finding)
            tallied.values.count(values, group)
            self._found.put((Where(group.name, group.topic_of(finding.input) or ""), finding.code), tallied)

    def add(self, other: Self) -> None:
        """Add those of other recordings."""
        self._found.add(other._found)

    @property
    def is_told(self) -> bool:
        """Whether there are no more than can be told apart."""
        return self._found.is_told

    def found(self) -> tuple[Found, ...]:
        """Return the findings: errors first, then what most recordings have, then what lasted longest."""
        rows = [_found(where, code, tallied) for (where, code), tallied in self._found.items()]
        return tuple(sorted(rows, key=_worst_first))


def _worst_first(found: Found) -> tuple[int, int, int, Where, str]:
    return (-SEVERITIES.index(found.severity), -found.recordings, -found.seconds, found.where, found.code)


def _tallied(recording: str, finding: Finding) -> _Tallied:
    example = _Example(finding.seconds, recording, finding.text, finding.suggestion or "")
    return _Tallied(1, finding.seconds, SEVERITIES.index(finding.severity), example)


def _found(where: Where, code: str, tallied: _Tallied) -> Found:
    example = tallied.example
    return Found(
        where=where,
        code=code,
        severity=SEVERITIES[tallied.severity],
        recordings=tallied.recordings,
        seconds=tallied.seconds,
        text=example.text,
        advice=example.advice,
        example=example.recording,
        values=tallied.values.suggested(),
        gain=tallied.values.gain(),
    )
