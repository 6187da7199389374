"""What was found in many recordings, and the values that were suggested for them."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, Self

from syncrelay.fleet.documents import Change, Finding, Group
from syncrelay.fleet.tally import Cells

SEVERITIES: Final = ("ok", "warn", "error")
# Of a finding: more than these are no help.
_MOST_VALUES: Final = 1000


@dataclass(frozen=True, slots=True, order=True)
class Where:
    """A group, and one of its topics; the empty text where it is about none of them alone."""

    group: str
    topic: str


@dataclass(frozen=True, slots=True, order=True)
class Value:
    """A key of a group, or of one of its topics, and a value as it stands in a file."""

    where: Where
    key: str
    value: str

    @property
    def written(self) -> str:
        """As it stands in a file."""
        return f"{self.key}: {self.value}"


@dataclass(frozen=True, slots=True)
class Gain:
    """What recordings give `now` and would give `then`, of `possible` sets, each with all that was suggested for it."""

    recordings: int
    now: int
    then: int
    possible: int


@dataclass(frozen=True, slots=True)
class Suggested:
    """A value, and the recordings that it was suggested for."""

    value: Value
    gain: Gain


@dataclass(frozen=True, slots=True)
class Found:
    """A finding of so many recordings, the sentences of the one in which it lasted longest, and what would help.

    `values` were suggested for so many of these recordings, the most often suggested first; `gain` is of those that
    any were suggested for.
    """

    where: Where
    code: str
    severity: str
    recordings: int
    seconds: int
    text: str
    advice: str
    example: str
    values: tuple[tuple[Value, int], ...]
    gain: Gain


@dataclass(slots=True)
class _Gained:
    recordings: int = 0
    now: int = 0
    then: int = 0
    possible: int = 0

    def add(self, other: Self) -> None:
        self.recordings += other.recordings
        self.now += other.now
        self.then += other.then
        self.possible += other.possible

    def gain(self) -> Gain:
        return Gain(self.recordings, self.now, self.then, self.possible)


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
    example: _Example | None = None
    values: Cells[Value, _Gained] = field(default_factory=lambda: Cells(_Gained, _MOST_VALUES))
    gained: _Gained = field(default_factory=_Gained)

    def add(self, other: Self) -> None:
        self.recordings += other.recordings
        self.seconds += other.seconds
        self.severity = max(self.severity, other.severity)
        self.example = max(filter(None, (self.example, other.example)), default=None)
        self.values.add(other.values)
        self.gained.add(other.gained)


class Findings:
    """The findings and the suggested values of recordings, as they come."""

    def __init__(self) -> None:
        self._found: Cells[tuple[Where, str], _Tallied] = Cells(_Tallied)
        self._suggested: Cells[Value, _Gained] = Cells(_Gained)

    def count(self, recording: str, group: Group) -> None:
        """Count what was found of a group in a recording."""
        values = {_value(group, change) for change in group.suggestion.changes}
        for value in values:
            self._suggested.put(value, _gained(group))
        for finding in {(each.input, each.code): each for each in group.findings}.values():
            where = Where(group.name, group.topic_of(finding.input) or "")
            tallied = _tallied(recording, finding)
            if values:
                tallied.gained = _gained(group)
            for value in values:
                tallied.values.put(value, _gained(group))
            self._found.put((where, finding.code), tallied)

    def add(self, other: Self) -> None:
        """Add counts."""
        self._found.add(other._found)
        self._suggested.add(other._suggested)

    @property
    def is_told(self) -> bool:
        """Whether there are no more than can be told apart."""
        return self._found.is_told and self._suggested.is_told

    def found(self) -> tuple[Found, ...]:
        """Return the findings: errors first, then what most recordings have, then what lasted longest."""
        rows = [_found(where, code, tallied) for (where, code), tallied in self._found.items()]
        return tuple(sorted(rows, key=_worst_first))

    def suggested(self) -> tuple[Suggested, ...]:
        """Return the values that were suggested, those for most recordings first."""
        rows = [Suggested(value, gained.gain()) for value, gained in self._suggested.items()]
        return tuple(sorted(rows, key=lambda each: (-each.gain.recordings, each.value)))


def _worst_first(found: Found) -> tuple[int, int, int, Where, str]:
    return (-SEVERITIES.index(found.severity), -found.recordings, -found.seconds, found.where, found.code)


def _value(group: Group, change: Change) -> Value:
    return Value(Where(group.name, group.topic_of(change.topic) or ""), change.key, str(change.value))


def _gained(group: Group) -> _Gained:
    found = group.suggestion
    return _Gained(1, found.now, found.then, found.possible)


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
        text=example.text if example else "",
        advice=example.advice if example else "",
        example=example.recording if example else "",
        values=tuple(_most_often(tallied)),
        gain=tallied.gained.gain(),
    )


def _most_often(tallied: _Tallied) -> Iterator[tuple[Value, int]]:
    rows = ((value, gained.recordings) for value, gained in tallied.values.items())
    yield from sorted(rows, key=lambda each: (-each[1], each[0]))
