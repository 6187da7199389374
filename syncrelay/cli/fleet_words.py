"""What a fleet's report says in words, on a terminal and on its page."""

from collections.abc import Iterator, Sequence
from typing import Final

from syncrelay.config.wording import counted
from syncrelay.explain import words
from syncrelay.printable import printable
from syncrelay.recordings.fleet.figures import RULE, Counts, Figures, Row
from syncrelay.recordings.fleet.report import FleetReport
from syncrelay.recordings.fleet.report_findings import Found
from syncrelay.recordings.fleet.suggestions import Gain, Suggested, Value, Where
from syncrelay.recordings.fleet.tally import Drift, Quantiles

NO_RATE: Final = "unknown"
ORDER: Final = f"Worst first: {RULE}."
RATE: Final = (
    "A match rate is the mean of the shares of possible sets that came together, one for each recording and group; a"
    " group without a set counts as 0 %. That of a topic is the share of its needed messages that went into sets."
)
_GOOD: Final = 0.99


def name_text(name: str | None) -> str:
    """Return the name of a row, on one line."""
    return "(not known)" if name is None else printable(name) or "(no name)"


def tone(match_rate: float | None) -> str:
    """Return the class of the style sheets for a match rate."""
    if match_rate is None:
        return "plain"
    return "ok" if match_rate >= _GOOD else "warn" if match_rate else "error"


def rate_text(match_rate: float | None) -> str:
    """Return a match rate in percent."""
    return NO_RATE if match_rate is None else words.share(match_rate)


def sets_text(now: int, possible: int, sets: int) -> str:
    """Return how many of the possible sets came together, or how many there were where nobody can know that."""
    return f"{now} of {counted(possible, 'possible set')}" if possible else counted(sets, "set")


def quantiles_text(found: Quantiles) -> str:
    """Return the quantiles of a quantity."""
    median, high, greatest = (words.duration(each) for each in (found.median, found.high, found.greatest))
    return f"median {median}, 95 % within {high}, at most {greatest}"


def middle_text(found: Quantiles) -> str:
    """Return the quantiles of what recordings told only the medians of: their 95th percentile is that of no message."""
    return f"median {words.duration(found.median)}, at most {words.duration(found.greatest)}"


def drift_text(drift: Drift | None) -> str:
    """Return the largest drift, and whose it is; nothing where there is none."""
    return "" if drift is None else f"{words.figure(drift.ppm)} ppm ({printable(drift.topic)})"


def clock_lines(figures: Figures) -> Iterator[str]:
    """Yield the largest drift, and what else is wrong with clocks and stamps."""
    if figures.drift is not None:
        yield f"largest drift {drift_text(figures.drift)}"
    yield from fault_lines(figures)


def fault_lines(figures: Figures) -> Iterator[str]:
    """Yield what is wrong with clocks and stamps, drift aside."""
    if figures.other_clock:
        yield f"{counted(figures.other_clock, 'clock')} more than 1 s off the recorder's"
    for what, count in figures.faults:
        yield f"{what}: {counted(count, 'message')}"


def gaps_text(figures: Figures) -> str:
    """Return how many gaps there are, and the longest; nothing where there is none."""
    if not figures.gaps:
        return ""
    return f"{figures.gaps}, longest {words.duration(figures.longest_gap)}"


def counts_text(counts: Counts) -> str:
    """Return counts by what was counted."""
    return ", ".join(f"{printable(name)} {count}" for name, count in counts)


def where_text(where: Where) -> str:
    """Return a group, and its topic where it is about one."""
    group = printable(where.group)
    return f"{group}, {printable(where.topic)}" if where.topic else group


def value_text(value: Value) -> str:
    """Return a value as it stands in the file, and at which topic."""
    at = f" at {printable(value.where.topic)}" if value.where.topic else ""
    return f"`{printable(value.written)}`{at}"


def values_text(values: Sequence[Suggested], gain: Gain, most: int) -> str:
    """Return which values were suggested and for how many recordings, and what they give."""
    has_groups = len({each.value.where.group for each in values}) > 1
    told = []
    for each in values[:most]:
        of_group = f" of {printable(each.value.where.group)}" if has_groups else ""
        told.append(f"{value_text(each.value)}{of_group} for {counted(each.gain.recordings, 'recording')}")
    if len(values) > most:
        told.append(f"{len(values) - most} more")
    return f"{', '.join(told)}; {'each with its own: ' if len(values) > 1 else ''}{gain_text(gain)}"


def gain_text(gain: Gain) -> str:
    """Return what the suggested values give in the recordings that they were suggested for."""
    possible = counted(gain.possible, "possible set")
    change = f"still {gain.then}" if gain.then == gain.now else f"{gain.now} -> {gain.then}"
    return f"{change} of {possible}"


def sentence_of(found: Found) -> str:
    """Return what was found where it lasted longest, and what to do."""
    return printable(f"{found.text}; {found.advice}" if found.advice else found.text)


def found_text(found: Found) -> str:
    """Return how much there is of a finding."""
    lasts = words.seconds(found.seconds * 1_000_000_000)
    return f"in {counted(found.recordings, 'recording')}, for {lasts} in all"


def suggested_text(suggested: Suggested) -> str:
    """Return for how many recordings a value was suggested, and what they give with all that was suggested for each."""
    return f"for {counted(suggested.gain.recordings, 'recording')}: {gain_text(suggested.gain)}"


def span_of_days(report: FleetReport) -> str:
    """Return the days that the recordings began on; nothing where no calendar has them."""
    days = sorted(row.name for row in report.by_day.rows if row.name is not None)
    if not days:
        return ""
    return f"begun on {days[0]}" if len(days) == 1 else f"begun from {days[0]} to {days[-1]}"


def head_text(report: FleetReport) -> str:
    """Return how much there is."""
    whole = report.whole
    robots = counted(len(named(report.by_robot.rows)), "robot") if named(report.by_robot.rows) else ""
    lasts = f"{words.seconds(whole.lasts)} in all"
    parts = (counted(whole.recordings, "recording"), robots, lasts, span_of_days(report))
    return ", ".join(part for part in parts if part)


def named(rows: tuple[Row, ...]) -> tuple[Row, ...]:
    """Return the rows that have a name."""
    return tuple(row for row in rows if row.name is not None)
