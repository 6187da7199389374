"""What a fleet's table of facts says at first sight: one screen of text."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from heapq import nsmallest
from statistics import fmean
from typing import Final

from syncrelay.config.wording import counted
from syncrelay.explain import words
from syncrelay.recordings.fleet.facts import FleetRow

ENOUGH: Final = 0.8
"""A group with a smaller share of its possible sets is not OK, in every view."""

_SECOND: Final = 1_000_000_000
_WIDTH: Final = 80
_LONGEST: Final = 40
"""Of longer paths the end is shown, which tells them apart."""
_WORST_GROUPS: Final = 5
_MOST: Final = 3


@dataclass(slots=True)
class Summary:
    """Takes the rows of a fleet in any order, and says what is in them in no more than 22 lines."""

    rows: int = 0
    _durations: dict[str, float] = field(default_factory=dict)
    _days: set[str] = field(default_factory=set)
    _failures: list[str] = field(default_factory=list)
    _worst: list[tuple[float, str, str, str]] = field(default_factory=list)
    _shares: list[float] = field(default_factory=list)
    _robots: defaultdict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    _codes: defaultdict[str, set[str]] = field(default_factory=lambda: defaultdict(set))
    _values: Counter[str] = field(default_factory=Counter)

    def take(self, row: FleetRow) -> None:
        """Take in a row."""
        self.rows += 1
        if row.group_name is None:
            why = (row.error or "").removeprefix(f"{row.recording}: ")
            self._failures.append(f"{_end_of(row.recording)}: {why}")
            return
        self._durations[row.recording] = row.duration_s or 0.0
        if row.day is not None:
            self._days.add(row.day)
        codes = dict.fromkeys(finding.code for finding in row.findings)
        for code in codes:
            self._codes[code].add(row.recording)
        for each in row.suggestions:
            at = f" at {each.topic}" if each.topic else ""
            self._values[f"{row.group_name}: `{each.key}: {each.value}`{at}"] += 1
        if row.robot is not None:
            # A robot without a share counts as one all the same.
            self._robots[row.robot].extend([] if row.share is None else [row.share])
        if row.share is not None:
            self._shares.append(row.share)
            self._worst.append((row.share, row.recording, row.group_name, ", ".join(codes)))
        if len(self._worst) > 1000 * _WORST_GROUPS:
            self._worst = nsmallest(_WORST_GROUPS, self._worst)

    def lines(self) -> Iterator[str]:
        """Yield the lines, none of them longer than 80 characters."""
        for line in [*self._head(), *self._ranked()]:
            yield line if len(line) <= _WIDTH else f"{line[: _WIDTH - 1]}…"

    def _head(self) -> Iterator[str]:
        robots = f" of {counted(len(self._robots), 'robot')}" if self._robots else ""
        lasts = words.seconds(sum(self._durations.values()) * _SECOND)
        days = sorted(self._days)
        begun = "" if not days else f", begun on {days[0]}" if len(days) == 1 else f", {days[0]} to {days[-1]}"
        yield f"{counted(len(self._durations), 'recording')}{robots}, {lasts} in all{begun}"
        if self._failures:
            yield f"not analyzed: {counted(len(self._failures), 'recording')}, such as {min(self._failures)}"
        if self._shares:
            low = sum(share < ENOUGH for share in self._shares)
            mean, enough = words.share(fmean(self._shares)), words.share(ENOUGH)
            of = counted(len(self._shares), "row")
            yield f"share of possible sets: {mean} on average, below {enough} in {low} of {of}"

    def _ranked(self) -> Iterator[str]:
        worst = nsmallest(_WORST_GROUPS, self._worst)
        yield from _section(
            "lowest shares",
            [
                f"{words.share(share):>6}  {group} in {_end_of(recording)}{f': {codes}' if codes else ''}"
                for share, recording, group, codes in worst
            ],
        )
        robots = sorted((fmean(shares), robot, len(shares)) for robot, shares in self._robots.items() if shares)
        if len(robots) > 1:
            yield from _section(
                "robots with the lowest average share",
                [f"{words.share(mean):>6}  {robot} ({counted(rows, 'row')})" for mean, robot, rows in robots[:_MOST]],
            )
        codes = sorted((-len(recordings), code) for code, recordings in self._codes.items())
        yield from _section(
            "most frequent findings, by recordings",
            [f"{-count:>6}  {code}" for count, code in codes[:_MOST]],
        )
        values = sorted(self._values.items(), key=lambda each: (-each[1], each[0]))
        yield from _section(
            "most frequent suggestions, by rows", [f"{rows:>6}  {value}" for value, rows in values[:_MOST]]
        )


def _section(title: str, lines: Sequence[str]) -> Iterator[str]:
    if lines:
        yield from (title, *lines)


def _end_of(path: str) -> str:
    return path if len(path) <= _LONGEST else f"…{path[1 - _LONGEST :]}"
