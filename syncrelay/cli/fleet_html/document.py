"""The page of a fleet: the worst rows as words that a template escapes, all others packed for a script to show."""

import gzip
import json
from base64 import b64encode
from dataclasses import dataclass, replace
from datetime import date
from typing import Final

from syncrelay.cli.fleet_html.tables import SHORT, PageTable, tables_of
from syncrelay.cli.fleet_words import (
    ORDER,
    RATE,
    clock_lines,
    counts_text,
    head_text,
    quantiles_text,
    rate_text,
    sets_text,
    tone,
    values_text,
)
from syncrelay.cli.pages import MARK, content_hash, joined, template
from syncrelay.config.wording import counted
from syncrelay.printable import printable
from syncrelay.recordings.fleet.figures import Figures, Ranking
from syncrelay.recordings.fleet.report import FleetReport

_PACKAGE: Final = "syncrelay.cli"
_STYLES: Final = ("../status/page/colours.css", "analysis_html/page/report.css", "fleet_html/page/fleet.css")
_SCRIPTS: Final = ("fleet_html/page/fleet.js",)
# Of 6 MB, what all else takes is far below the rest.
_MOST_PACKED: Final = 4_500_000
_AT_FIRST: Final = 10
_MOST_FAILURES: Final = 500
_LONGEST_FAILURE: Final = 600
_MOST_DAYS: Final = 400
_VALUES: Final = 12


@dataclass(frozen=True, slots=True)
class DayBar:
    """A day of the drawing: how many days after the first, its height in percent, its class, and what it says."""

    at: int
    height: float
    tone: str
    text: str


def fleet_as_html(report: FleetReport, *, most_packed: int = _MOST_PACKED) -> str:
    """Return the page, which stays below 6 MB: of what takes more than `most_packed` characters, the worst is there."""
    tables, rows = _packed(tables_of(report), most_packed)
    script, style = joined(_PACKAGE, _SCRIPTS), joined(_PACKAGE, _STYLES)
    whole = report.whole
    days = _day_bars(report.by_day)
    page: str = template("syncrelay.cli.fleet_html", "fleet.html.jinja").render(
        mark=MARK,
        head=head_text(report),
        verdict=f"{rate_text(whole.match_rate)} match rate: {sets_text(whole.now, whole.possible, whole.sets)}",
        tone=tone(whole.match_rate),
        figures=_figures(whole),
        failed=counted(report.failed, "recording") if report.failed else "",
        failures=[printable(each.why)[:_LONGEST_FAILURE] for each in report.failures[:_MOST_FAILURES]],
        more_failures=max(0, report.failed - _MOST_FAILURES),
        order=ORDER,
        rate=RATE,
        days=days,
        n_days=days[-1].at + 1 if days else 0,
        tables=tables,
        at_first=_AT_FIRST,
        short=SHORT,
        rows=rows,
        script=script,
        style=style,
        script_hash=content_hash(script),
        style_hash=content_hash(style),
    )
    return page


def _packed(tables: list[PageTable], most: int) -> tuple[list[PageTable], str]:
    """Return the tables with as many rows as fit, and these rows packed; the table that takes most gives way first."""
    while True:
        written = {table.key: json.dumps(_for_script(table), separators=(",", ":")) for table in tables}
        text = "{" + ",".join(f"{json.dumps(key)}:{rows}" for key, rows in written.items()) + "}"
        # Without a time in it, the same report makes the same file.
        packed = b64encode(gzip.compress(text.encode(), mtime=0)).decode("ascii")
        if len(packed) <= most or not any(table.rows for table in tables):
            return tables, packed
        largest = max(written, key=lambda key: len(written[key]))
        tables = [_halved(table) if table.key == largest else table for table in tables]


def _halved(table: PageTable) -> PageTable:
    return replace(table, rows=table.rows[: len(table.rows) // 2])


def _for_script(table: PageTable) -> list[list[object]]:
    return [[row.tone, _percent(row.share), *row.cells] for row in table.rows]


def _percent(share: float | None) -> float | None:
    return None if share is None else round(100 * share, 1)


def _figures(whole: Figures) -> dict[str, str]:
    told = {
        "Span of the sets": quantiles_text(whole.span) if whole.span else "",
        "Latency of the sets": quantiles_text(whole.latency) if whole.latency else "",
        "Groups without a set": f"{whole.without} of {whole.judged} in all recordings" if whole.without else "",
        "Clocks and stamps": ", ".join(clock_lines(whole)),
        "Dropped": counts_text(whole.dropped),
        "Recordings with findings": counts_text(whole.codes),
        "Suggested values": values_text(whole.values, whole.gain, _VALUES).replace("->", "→") if whole.values else "",
    }
    return {what: text for what, text in told.items() if text}


def _day_bars(ranking: Ranking) -> list[DayBar]:
    """Return a bar for each day; none where one bar would tell nothing, or all would be too thin to see."""
    known = sorted((row.name, row.figures) for row in ranking.rows if row.name and row.figures.match_rate is not None)
    if len(known) < 2:  # noqa: PLR2004  one day is no row of days
        return []
    days = [date.fromisoformat(name) for name, _ in known]
    if (days[-1] - days[0]).days >= _MOST_DAYS:
        return []
    return [
        DayBar(
            at=(day - days[0]).days,
            height=100 * (figures.match_rate or 0),
            tone=tone(figures.match_rate),
            text=f"{name}: {rate_text(figures.match_rate)}, {counted(figures.recordings, 'recording')}",
        )
        for day, (name, figures) in zip(days, known, strict=True)
    ]
