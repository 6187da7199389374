"""What many recordings tell together: by robot, day, topic and group, the worst first. One pass, in bounded memory."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from heapq import nsmallest
from typing import Final, Self

from syncrelay.errors import BagError
from syncrelay.recordings.fleet.cells import Cells
from syncrelay.recordings.fleet.documents import Document, read_document
from syncrelay.recordings.fleet.figures import Figures, Ranking, Row, figures_of, worst_first
from syncrelay.recordings.fleet.measuring import Measured, measured, worst_severity
from syncrelay.recordings.fleet.report_findings import Findings, Found
from syncrelay.recordings.fleet.robots import RobotPattern, common_folders, folder_below, folders_of
from syncrelay.recordings.fleet.tally import WHOLE_PPM, Drift, Quantiles, Tally

MOST_RECORDINGS: Final = 10_000
"""Of more, the worst are listed one by one."""

_MOST_FAILURES: Final = 1000


@dataclass(frozen=True, slots=True)
class Recording:
    """One recording; `rank` sorts it among others, the worst first by RULE. See Figures."""

    rank: tuple[int, int, str]
    name: str
    robot: str | None
    begin: int
    lasts: int
    match_rate: float | None
    sets: int
    now: int
    possible: int
    span: Quantiles | None
    latency: Quantiles | None
    other_clock: int
    drift: Drift | None
    codes: tuple[str, ...]
    severity: str


@dataclass(frozen=True, slots=True, order=True)
class Failure:
    """A recording that could not be analyzed, or whose analysis could not be read, and why."""

    name: str
    why: str


@dataclass(frozen=True, slots=True)
class FleetReport:
    """What many recordings tell together.

    `begin` is when the first of them began, `last_begin` when the last did, None without any. `robots_by` says how
    robots were told apart. Of `recordings` the worst are listed, of `failures` the first by name; `failed` counts all
    of the latter.
    """

    whole: Figures
    begin: int | None
    last_begin: int | None
    robots_by: str
    by_robot: Ranking
    by_day: Ranking
    by_group: Ranking
    by_topic: Ranking
    findings: tuple[Found, ...]
    are_findings_told: bool
    recordings: tuple[Recording, ...]
    failures: tuple[Failure, ...]
    failed: int


def fleet_report(
    documents: Iterable[tuple[str, object]], *, robot: str | None = None, failed: Iterable[Failure] = ()
) -> FleetReport:
    """Return the report of recordings: of each the path or URL, and what json.loads makes of its analysis.

    `robot` is a pattern as RobotPattern reads it; without one a robot is the first folder below the one that all
    recordings lie in. A document that is no analysis is a failure. Raises UsageError for a pattern that is none.
    """
    fleet = Fleet(None if robot is None else RobotPattern.parse(robot))
    for name, document in documents:
        fleet.take(name, document)
    for failure in failed:
        fleet.fail(failure)
    return fleet.report()


class Fleet:
    """Takes recordings as they come, in any order, and others of its kind: parts give the report of the whole."""

    def __init__(self, pattern: RobotPattern | None) -> None:
        self._pattern = pattern
        self._whole = Tally()
        self._common: tuple[str, ...] | None = None
        self._robots: Cells[str | None, Tally] = Cells(Tally)
        self._days: Cells[str | None, Tally] = Cells(Tally)
        self._groups: Cells[str | None, Tally] = Cells(Tally)
        self._topics: Cells[str | None, Tally] = Cells(Tally)
        self._findings = Findings()
        self._recordings: list[Recording] = []
        self._failures: list[Failure] = []
        self._failed = 0
        self._begins: tuple[int, int] | None = None

    def take(self, name: str, found: object) -> None:
        """Add a recording, by its path or URL, and its document."""
        try:
            document = read_document(name, found)
        except BagError as error:
            self.fail(Failure(name, str(error)))
            return
        figures = measured(name, document)
        self._gather(folders_of(name))
        self._robots.put(self._robot_of(name), figures.whole)
        self._days.put(figures.day, figures.whole)
        for group, tally in figures.groups.items():
            self._groups.put(group, tally)
        for topic, tally in figures.topics.items():
            self._topics.put(topic, tally)
        for each in document.groups:
            self._findings.count(name, each)
        self._whole.add(figures.whole)
        self._spread((figures.begin, figures.begin))
        self._list([_listed(figures, document)])

    def fail(self, failure: Failure) -> None:
        """Add a recording that has no analysis."""
        self._failed += 1
        self._keep([failure])

    def add(self, other: Self) -> None:
        """Add what another one took, with the same pattern."""
        if other._common is not None:
            self._gather(other._common)
            robots = other._robots
            if self._common != other._common and self._pattern is None:
                robots = _all_in(folder_below(self._common or (), other._common), other._whole)
            self._robots.add(robots)
        self._days.add(other._days)
        self._groups.add(other._groups)
        self._topics.add(other._topics)
        self._findings.add(other._findings)
        self._whole.add(other._whole)
        if other._begins is not None:
            self._spread(other._begins)
        self._list(other._recordings)
        self._failed += other._failed
        self._keep(other._failures)

    def report(self) -> FleetReport:
        """Return what was taken so far."""
        listed = (replace(each, robot=self._robot_of(each.name)) for each in _worst(self._recordings))
        begin, last_begin = self._begins or (None, None)
        return FleetReport(
            whole=figures_of(self._whole),
            begin=begin,
            last_begin=last_begin,
            robots_by=self._robots_by(),
            by_robot=_ranked(self._robots),
            by_day=_ranked(self._days),
            by_group=_ranked(self._groups),
            by_topic=_ranked(self._topics),
            findings=self._findings.found(),
            are_findings_told=self._findings.is_told and self._whole.values.is_told,
            recordings=tuple(listed),
            failures=tuple(sorted(self._failures)[:_MOST_FAILURES]),
            failed=self._failed,
        )

    def _robots_by(self) -> str:
        if self._pattern is not None:
            return f"by {self._pattern.written}"
        return f"by the first folder below {'/'.join(self._common or ()) or '/'}"

    def _robot_of(self, name: str) -> str | None:
        if self._pattern is not None:
            return self._pattern.robot_of(name)
        return folder_below(self._common or (), folders_of(name))

    def _gather(self, folders: tuple[str, ...]) -> None:
        """Make the common folder one that these lie in too; what came before then lies in one folder below it."""
        if self._common is None:
            self._common = folders
            return
        common = common_folders(self._common, folders)
        if common != self._common:
            if self._pattern is None:
                self._robots = _all_in(folder_below(common, self._common), self._whole)
            self._common = common

    def _spread(self, begins: tuple[int, int]) -> None:
        first, last = self._begins or begins
        self._begins = (min(first, begins[0]), max(last, begins[1]))

    def _list(self, recordings: list[Recording]) -> None:
        self._recordings.extend(recordings)
        if len(self._recordings) > 2 * MOST_RECORDINGS:
            self._recordings = _worst(self._recordings)

    def _keep(self, failures: list[Failure]) -> None:
        self._failures.extend(failures)
        if len(self._failures) > 2 * _MOST_FAILURES:
            self._failures = sorted(self._failures)[:_MOST_FAILURES]


def _all_in(folder: str | None, whole: Tally) -> Cells[str | None, Tally]:
    cells: Cells[str | None, Tally] = Cells(Tally)
    cells.put(folder, whole)
    return cells


def _ranked(cells: Cells[str | None, Tally]) -> Ranking:
    rows = (Row(name, figures_of(tally)) for name, tally in cells.items())
    return Ranking(tuple(sorted(rows, key=worst_first)), cells.is_told)


def _worst(recordings: list[Recording]) -> list[Recording]:
    return nsmallest(MOST_RECORDINGS, recordings, key=lambda each: (each.rank, each.begin, each.lasts, each.sets))


def _listed(figures: Measured, document: Document) -> Recording:
    found, name = figures_of(figures.whole), figures.name
    # Beyond all rates where there is none.
    rate = 2 * WHOLE_PPM if found.match_rate is None else round(found.match_rate * WHOLE_PPM)
    return Recording(
        rank=(rate, -len(found.codes), name),
        name=name,
        robot=None,
        begin=figures.begin,
        lasts=found.lasts,
        match_rate=found.match_rate,
        sets=found.sets,
        now=found.now,
        possible=found.possible,
        span=found.span,
        latency=found.latency,
        other_clock=found.other_clock,
        drift=found.drift,
        codes=tuple(code for code, _ in found.codes),
        severity=worst_severity(each.severity for group in document.groups for each in group.findings),
    )
