"""The tables of a fleet's page: what stands in each row, the worst first."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from syncrelay.cli.fleet_words import (
    counts_text,
    drift_text,
    fault_lines,
    found_text,
    gain_text,
    gaps_text,
    name_text,
    rate_text,
    sentence_of,
    tone,
    value_text,
    values_text,
    where_text,
)
from syncrelay.cli.pages import when
from syncrelay.config.wording import counted
from syncrelay.explain import words
from syncrelay.printable import printable
from syncrelay.recordings.fleet.cells import MOST_ROWS
from syncrelay.recordings.fleet.figures import Figures, Ranking, Row
from syncrelay.recordings.fleet.report import FleetReport, Recording
from syncrelay.recordings.fleet.report_findings import Found
from syncrelay.recordings.fleet.robots import common_folders, folders_of
from syncrelay.recordings.fleet.suggestions import Gain, Suggested
from syncrelay.recordings.fleet.tally import Quantiles

_QUANTILES: Final = "median / 95 % / most"
_MIDDLE: Final = "median / most"
_SHARED: Final = ("Drift", "Clocks and stamps", "Dropped", "Recordings with findings", "Suggested values")
_VALUES: Final = 3
_ARROW: Final = "\N{RIGHTWARDS ARROW}"
# A row with a path of 4096 characters helps nobody, and a thousand of them fill the page.
_LONGEST_CELL: Final = 600
SHORT: Final = 36
"""A cell of no more characters stays on one line."""


@dataclass(frozen=True, slots=True)
class PageRow:
    """A row: a class of the style sheet, a share of 1 for a bar, None where there is none, and the cells."""

    tone: str
    share: float | None
    cells: tuple[str, ...]

    @classmethod
    def of(cls, tone: str, share: float | None, cells: Iterable[str]) -> "PageRow":
        """Make a row of cells that are not too long to be read."""
        return cls(tone, share, tuple(map(_short, cells)))


@dataclass(frozen=True, slots=True)
class PageTable:
    """A table of `of` rows, of which the worst are there; `bar` is the column with the bar, None without one."""

    key: str
    title: str
    note: str
    columns: tuple[str, ...]
    rows: tuple[PageRow, ...]
    of: int
    bar: int | None = 1


def tables_of(report: FleetReport) -> list[PageTable]:
    """Return the tables that have rows, or a note on why they have none."""
    tables = [
        _findings(report),
        _suggested(report),
        _ranking("groups", "Groups", "", report.by_group),
        _ranking("robots", "Robots", f"Told apart {printable(report.robots_by)}.", report.by_robot),
        _topics(report.by_topic),
        _ranking("days", "Days", "In UTC, by when a recording begins.", report.by_day),
        _recordings(report),
    ]
    return [table for table in tables if table.rows or table.note]


def _ranking(key: str, title: str, note: str, ranking: Ranking) -> PageTable:
    columns = (
        "Match rate",
        "Of possible sets",
        "Recordings",
        "No set",
        f"Span: {_QUANTILES}",
        f"Latency: {_QUANTILES}",
        *_SHARED,
    )
    rows = _rows(ranking, _figures)
    if not rows and ranking.is_told:
        note = ""
    return PageTable(key, title, _too_many(note, ranking), (title[:-1], *columns), rows, len(rows))


def _topics(ranking: Ranking) -> PageTable:
    columns = (
        *("Topic", "Match rate", "Of needed messages", "Recordings", "No message", f"Distance: {_MIDDLE}"),
        *(f"Delay: {_MIDDLE}", "Gaps", *_SHARED),
    )
    note = "Distance is to the nearest message of the other topics, delay from stamp to receipt."
    rows = _rows(ranking, _of_topic)
    return PageTable("topics", "Topics", _too_many(note, ranking), columns, rows, len(rows))


def _too_many(note: str, ranking: Ranking) -> str:
    return note if ranking.is_told else f"More than {MOST_ROWS}, which are not told apart. {note}".strip()


def _rows(ranking: Ranking, cells: Callable[[Figures], tuple[str, ...]]) -> tuple[PageRow, ...]:
    if len(ranking.rows) == 1 and ranking.rows[0].name is None:
        return ()
    return tuple(_row(row, cells(row.figures)) for row in ranking.rows)


def _row(row: Row, cells: Iterable[str]) -> PageRow:
    rate = row.figures.match_rate
    return PageRow.of(tone(rate), rate, (name_text(row.name), rate_text(rate), *cells))


def _figures(figures: Figures) -> tuple[str, ...]:
    sets = _sets(figures.now, figures.possible, figures.sets)
    numbers = (sets, str(figures.recordings), str(figures.without or ""))
    return (*numbers, _quantiles(figures.span), _quantiles(figures.latency), *_shared(figures))


def _of_topic(figures: Figures) -> tuple[str, ...]:
    used = f"{figures.matched} of {figures.received - figures.unneeded}"
    numbers = (used, str(figures.recordings), str(figures.without or ""))
    quantiles = (_middle(figures.span), _middle(figures.latency))
    return (*numbers, *quantiles, gaps_text(figures), *_shared(figures))


def _shared(figures: Figures) -> tuple[str, ...]:
    return (
        drift_text(figures.drift),
        ", ".join(fault_lines(figures)),
        counts_text(figures.dropped),
        counts_text(figures.codes),
        _better(figures.values, figures.gain),
    )


def _sets(now: int, possible: int, sets: int) -> str:
    return f"{now} of {possible}" if possible else counted(sets, "set")


def _better(values: Sequence[Suggested], gain: Gain) -> str:
    # An arrow of two characters would be torn apart at the end of a line.
    return values_text(values, gain, _VALUES).replace("->", _ARROW) if values else ""


def _quantiles(found: Quantiles | None) -> str:
    if found is None:
        return ""
    return " / ".join(words.duration(each) for each in (found.median, found.high, found.greatest))


def _middle(found: Quantiles | None) -> str:
    return "" if found is None else f"{words.duration(found.median)} / {words.duration(found.greatest)}"


def _findings(report: FleetReport) -> PageTable:
    rows = tuple(_found(each) for each in report.findings)
    columns = ("Finding", "Group, topic", "How much", "Where it lasted longest", "What is so", "Suggested values there")
    note = "Errors first, then what most recordings have."
    if not report.are_findings_told:
        note = "There are more findings or suggested values than can be told apart."
    elif not rows:
        note = ""
    return PageTable("findings", "Findings", note, columns, rows, len(rows), bar=None)


def _found(found: Found) -> PageRow:
    of = (f"{found.severity} {printable(found.code)}", where_text(found.where), found_text(found))
    return PageRow.of(
        found.severity, None, (*of, printable(found.example), sentence_of(found), _better(found.values, found.gain))
    )


def _suggested(report: FleetReport) -> PageTable:
    rows = tuple(_value(each) for each in report.whole.values)
    note = "Sets are those that these recordings give, and would give with all that was suggested for each of them."
    columns = ("Group", "Value", "Recordings", "Sets")
    return PageTable("values", "Suggested values", note if rows else "", columns, rows, len(rows), bar=None)


def _value(each: Suggested) -> PageRow:
    of = (printable(each.value.where.group), value_text(each.value), str(each.gain.recordings))
    return PageRow.of("plain", None, (*of, gain_text(each.gain).replace("->", _ARROW)))


def _recordings(report: FleetReport) -> PageTable:
    common: tuple[str, ...] | None = None
    for each in report.recordings:
        folders = folders_of(each.name)
        common = folders if common is None else common_folders(common, folders)
    below = f"{'/'.join(common)}/" if common else ""
    columns = (
        *("Recording", "Match rate", "Of possible sets", "Robot", "Begun", "Lasts"),
        *(f"Span: {_QUANTILES}", f"Latency: {_QUANTILES}", "Drift", "Findings"),
    )
    note = f"Paths are below {printable(below)}." if below else ""
    rows = tuple(_recording(each, below) for each in report.recordings)
    return PageTable("recordings", "Recordings", note, columns, rows, report.whole.recordings)


def _recording(each: Recording, below: str) -> PageRow:
    cells = (
        printable(each.name.removeprefix(below)),
        rate_text(each.match_rate),
        _sets(each.now, each.possible, each.sets),
        "" if each.robot is None else printable(each.robot),
        when(each.begin),
        words.seconds(each.lasts),
        _quantiles(each.span),
        _quantiles(each.latency),
        drift_text(each.drift),
        ", ".join(map(printable, each.codes)),
    )
    return PageRow.of(tone(each.match_rate), each.match_rate, cells)


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST_CELL else f"{text[: _LONGEST_CELL // 2]}…{text[-_LONGEST_CELL // 2 :]}"
