"""The values of a fleet's report: figures of many recordings, ranked."""

from collections import Counter
from dataclasses import dataclass
from typing import Final

from syncrelay.recordings.fleet.suggestions import Gain, Suggested
from syncrelay.recordings.fleet.tally import WHOLE_PPM, Drift, Quantiles, Tally

RULE: Final = "the lowest match rate, then the most recordings with findings, then the name"
"""What makes a row worse than another, for people to read."""

Counts = tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Figures:
    """What recordings add up to; times in nanoseconds, counts of messages but where it says otherwise.

    `match_rate`, 0 to 1, is the mean of the shares of possible sets that came together, one for each recording and
    group: where a group gave no set it is 0, where nobody can know what was possible there is none. Those are `judged`;
    `without` of them gave no set. `now` of `possible` sets came together; `sets` left, of all groups.

    Of a topic, the match rate is the share of its needed messages that went into sets, `judged` counts its uses by
    groups, `without` those without a message; `span` is the distance to the nearest messages of the group's other
    topics, `latency` the time from stamp to receipt, both by the medians of the recordings.

    `dropped` is by reason, `codes` counts the recordings with a finding, the most first. `faults` counts what is wrong
    with stamps; `other_clock` how often a topic of a recording was stamped more than a second off its receipt.

    `values` were suggested for some of the recordings, those for most of them first, of a topic those at the topic;
    `gain` is of all recordings that any were suggested for.
    """

    recordings: int
    lasts: int
    match_rate: float | None
    judged: int
    without: int
    sets: int
    now: int
    possible: int
    span: Quantiles | None
    latency: Quantiles | None
    received: int
    matched: int
    unneeded: int
    dropped: Counts
    faults: Counts
    gaps: int
    longest_gap: int
    other_clock: int
    drift: Drift | None
    codes: Counts
    values: tuple[Suggested, ...]
    gain: Gain


@dataclass(frozen=True, slots=True)
class Row:
    """A robot, topic, day or group; None where a recording does not tell which."""

    name: str | None
    figures: Figures


@dataclass(frozen=True, slots=True)
class Ranking:
    """Rows, the worst first by RULE; none and not `is_told` where there would be too many to tell them apart."""

    rows: tuple[Row, ...]
    is_told: bool


def figures_of(tally: Tally) -> Figures:
    """Return what a tally adds up to."""
    return Figures(
        recordings=tally.recordings,
        lasts=tally.lasts,
        match_rate=tally.rate_ppm / tally.rated / WHOLE_PPM if tally.rated else None,
        judged=tally.judged,
        without=tally.without,
        sets=tally.sets,
        now=tally.now,
        possible=tally.possible,
        span=tally.span.quantiles(),
        latency=tally.latency.quantiles(),
        received=tally.received,
        matched=tally.matched,
        unneeded=tally.unneeded,
        dropped=most_first(tally.dropped),
        faults=most_first(tally.faults),
        gaps=tally.gaps,
        longest_gap=tally.longest_gap,
        other_clock=tally.other_clock,
        drift=tally.drift,
        codes=most_first(tally.codes),
        values=tally.values.suggested(),
        gain=tally.values.gain(),
    )


def most_first(counts: Counter[str]) -> Counts:
    """Return what was counted, the most first."""
    return tuple(
        sorted(((name, count) for name, count in counts.items() if count), key=lambda each: (-each[1], each[0]))
    )


def worst_first(row: Row) -> tuple[float, int, str]:
    """Return what RULE sorts by; what has no match rate comes last."""
    rate = row.figures.match_rate
    return (2.0 if rate is None else rate, -sum(count for _, count in row.figures.codes), row.name or "")
