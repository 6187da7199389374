"""A fleet's report as lines of text, the worst of everything first."""

import re
from collections.abc import Callable, Iterator, Sequence
from textwrap import wrap
from typing import Final, TypeVar

from syncrelay.cli.fleet_words import (
    ORDER,
    RATE,
    clock_lines,
    counts_text,
    found_text,
    gaps_text,
    head_text,
    middle_text,
    name_text,
    quantiles_text,
    rate_text,
    sentence_of,
    sets_text,
    suggested_text,
    value_text,
    values_text,
    where_text,
)
from syncrelay.config.wording import counted
from syncrelay.printable import printable
from syncrelay.recordings.fleet.cells import MOST_ROWS
from syncrelay.recordings.fleet.figures import Figures, Ranking, Row
from syncrelay.recordings.fleet.report import FleetReport, Recording
from syncrelay.recordings.fleet.report_findings import Found
from syncrelay.recordings.fleet.suggestions import Suggested

MOST: Final = 10
"""So many of each kind are told."""

_WIDTH: Final = 80
_HARD_SPACE: Final = "\N{NO-BREAK SPACE}"
# A path may be 4096 characters long; its end tells it from others.
_LONGEST_NAME: Final = 64
_FAILURES: Final = 5
_VALUES_TITLE: Final = "suggested values, those for most recordings first; each recording with all of its own"
# Neither a value as it stands in the file nor a figure and its unit are torn apart.
_TOGETHER: Final = re.compile(r"`[^`]*`|\d (?:%|s|ms|us|ns|min|h|ppm)\b|\d %")
_VALUES: Final = 6

Each = TypeVar("Each")


def fleet_lines(report: FleetReport) -> Iterator[str]:
    """Yield the lines, none of them wider than 80 characters."""
    yield from _wrapped(head_text(report))
    yield from _figures(report.whole)
    yield from _failures(report)
    yield ""
    yield from _wrapped(f"{ORDER} {RATE}")
    yield from _section("findings, errors first, then those of most recordings", report.findings, _found)
    yield from _section(_VALUES_TITLE, report.whole.values, _suggested)
    if not report.are_findings_told:
        yield from _wrapped(f"more than {MOST_ROWS} findings or values: they are not told apart")
    yield from _ranking("groups", report.by_group, _row)
    yield from _ranking(f"robots, {report.robots_by}", report.by_robot, _row)
    yield from _ranking("topics", report.by_topic, _topic)
    yield from _ranking("days, in UTC", report.by_day, _row)
    yield from _section("recordings", report.recordings, _recording, of=report.whole.recordings)


def _failures(report: FleetReport) -> Iterator[str]:
    if not report.failed:
        return
    yield f"not analyzed: {counted(report.failed, 'recording')}"
    for each in report.failures[:_FAILURES]:
        yield from _wrapped(_short(printable(each.why), 3 * _WIDTH), 2)
    if report.failed > _FAILURES:
        yield f"  and {report.failed - _FAILURES} more"


def _ranking(title: str, ranking: Ranking, lines: Callable[[Row], Iterator[str]]) -> Iterator[str]:
    if not ranking.is_told:
        yield ""
        yield from _wrapped(f"{printable(title)}: more than {MOST_ROWS}, which are not told apart")
    elif len(ranking.rows) > 1 or any(row.name is not None for row in ranking.rows):
        yield from _section(title, ranking.rows, lines)


def _section(
    title: str, rows: Sequence[Each], lines: Callable[[Each], Iterator[str]], *, of: int | None = None
) -> Iterator[str]:
    count = len(rows) if of is None else of
    if not rows:
        return
    yield ""
    yield from _wrapped(printable(title) + (f" (worst {MOST} of {count})" if count > MOST else ""))
    for row in rows[:MOST]:
        yield from lines(row)
    if count > MOST:
        yield f"  and {count - MOST} more"


def _row(row: Row) -> Iterator[str]:
    yield from _wrapped(f"{_short(name_text(row.name))}: {_about(row.figures)}", 2)
    yield from _figures(row.figures, 4)
    yield from _better(row.figures)


def _about(figures: Figures) -> str:
    without = f", {counted(figures.without, 'time')} without a set" if figures.without else ""
    return f"{counted(figures.recordings, 'recording')}{without}"


def _figures(figures: Figures, indent: int = 2) -> Iterator[str]:
    sets = sets_text(figures.now, figures.possible, figures.sets)
    lines = {
        "match rate": f"{rate_text(figures.match_rate)}, {sets}",
        "span": quantiles_text(figures.span) if figures.span else "",
        "latency": quantiles_text(figures.latency) if figures.latency else "",
        **_messages(figures),
    }
    yield from _told(lines, indent)


def _better(figures: Figures) -> Iterator[str]:
    if figures.values:
        yield from _told({"suggested": values_text(figures.values, figures.gain, _VALUES)}, 4)


def _messages(figures: Figures) -> dict[str, str]:
    unneeded = f" ({figures.unneeded} of these not needed)" if figures.unneeded else ""
    return {
        "clocks": ", ".join(clock_lines(figures)),
        "dropped": f"{counts_text(figures.dropped)}{unneeded}" if figures.dropped else "",
        "findings": f"{counts_text(figures.codes)} (recordings)" if figures.codes else "",
    }


def _topic(row: Row) -> Iterator[str]:
    figures = row.figures
    without = f", {counted(figures.without, 'time')} without a message" if figures.without else ""
    yield from _wrapped(f"{_short(name_text(row.name))}: {counted(figures.recordings, 'recording')}{without}", 2)
    used = f"{figures.matched} of {counted(figures.received - figures.unneeded, 'needed message')} in sets"
    lines = {
        "match rate": f"{rate_text(figures.match_rate)}, {used}" if figures.judged else "",
        "distance": f"to the nearest of the others {middle_text(figures.span)}" if figures.span else "",
        "delay": f"received after the stamp {middle_text(figures.latency)}" if figures.latency else "",
        "gaps": gaps_text(figures),
        **_messages(figures),
    }
    yield from _told(lines, 4)
    yield from _better(figures)


def _told(lines: dict[str, str], indent: int) -> Iterator[str]:
    for what, text in lines.items():
        if text:
            yield from _wrapped(f"{what}: {text}", indent)


def _found(found: Found) -> Iterator[str]:
    where = _short(where_text(found.where))
    yield from _wrapped(f"{found.severity} {printable(found.code)} of {where}: {found_text(found)}", 2)
    yield from _wrapped(f"longest in {_short(printable(found.example))}: {sentence_of(found)}", 4)
    if found.values:
        yield from _wrapped(f"suggested there: {values_text(found.values, found.gain, _VALUES)}", 4)


def _suggested(suggested: Suggested) -> Iterator[str]:
    group = _short(printable(suggested.value.where.group))
    yield from _wrapped(f"{group}: {value_text(suggested.value)} {suggested_text(suggested)}", 2)


def _recording(each: Recording) -> Iterator[str]:
    sets = sets_text(each.now, each.possible, each.sets)
    found = f"; {', '.join(map(printable, each.codes))}" if each.codes else ""
    yield from _wrapped(f"{_short(printable(each.name))}: {rate_text(each.match_rate)}, {sets}{found}", 2)


def _short(text: str, most: int = _LONGEST_NAME) -> str:
    return text if len(text) <= most else f"…{text[1 - most :]}"


def _wrapped(text: str, indent: int = 0) -> Iterator[str]:
    joined = _TOGETHER.sub(lambda found: found[0].replace(" ", _HARD_SPACE), text)
    begin, later = " " * indent, " " * (indent + 2)
    for line in wrap(joined, _WIDTH, initial_indent=begin, subsequent_indent=later, break_on_hyphens=False):
        yield line.replace(_HARD_SPACE, " ")
