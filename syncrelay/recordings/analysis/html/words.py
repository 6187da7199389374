"""What the page says in words and tables."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

from syncrelay.config.wording import all_of, counted
from syncrelay.explain import Severity, in_words, words
from syncrelay.recordings.analysis import GroupAnalysis, patch
from syncrelay.recordings.analysis.html.drawings import Drawings
from syncrelay.recordings.analysis.nearest import Pair, worth_seeing
from syncrelay.recordings.analysis.report_text import (
    delay_line,
    faults_of,
    other_pairs,
    pair_line,
    period_text,
    promise,
    sampled_line,
    size_text,
    slop_text,
    unneeded_line,
)
from syncrelay.recordings.analysis.topics import TopicFigures
from syncrelay.recordings.analysis.unneeded import InputFates
from syncrelay.recordings.analysis.watching import LastingFinding, alike
from syncrelay.status.fates import FATES, MATCHED, UNNEEDED
from syncrelay.sync import DropReason

_GOOD = 0.99
_SIGNS = {Severity.ERROR: "\N{MULTIPLICATION X}", Severity.WARN: "!"}


@dataclass(frozen=True, slots=True)
class TopicRow:
    """A topic's figures, a cell for each of COLUMNS."""

    COLUMNS: ClassVar = ("Type", "Messages", "Rate", "Period", "Gaps", "Faults of stamps", "Received")

    topic: str
    cells: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Note:
    """A finding: a class of the style sheet, a sign, its severity in a word, what is so.

    `others` is what is so of other inputs that it is found of, and `likewise` a word for them, empty where it is alone.
    """

    tone: str
    sign: str
    word: str
    text: str
    likewise: str = ""
    others: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of a bar, from `begin` on, in percent of the whole."""

    fate: str
    count: int
    begin: float
    width: float


@dataclass(frozen=True, slots=True)
class FateRow:
    """Where an input's messages went: a count for each fate of the table, which add up to those received."""

    topic: str
    received: int
    counts: tuple[int, ...]
    bar: tuple[Segment, ...]


@dataclass(frozen=True, slots=True)
class PairWords:
    """How far apart two topics are, and the place of the pair's histogram among those that are drawn."""

    at: int
    text: str


@dataclass(frozen=True, slots=True)
class GroupWords:
    """All that is said of a group."""

    name: str
    policy: str
    sets: int
    verdict: str
    tone: str
    notes: tuple[Note, ...]
    hints: tuple[str, ...]
    promise: str
    patch: str
    reasons: tuple[str, ...]
    fates: tuple[str, ...]
    rows: tuple[FateRow, ...]
    pairs: tuple[PairWords, ...]
    other_pairs: tuple[PairWords, ...]
    others: str
    unneeded: str
    by_slop: tuple[tuple[str, int, str], ...]
    by_queue_size: tuple[tuple[str, int], ...]
    sampled: str
    thinned: str
    astray: str


def topic_row(topic: TopicFigures) -> TopicRow:
    """Return the row of a topic."""
    gaps = str(topic.gaps)
    if topic.gaps and topic.longest_gap is not None:
        gaps += f", longest {words.duration(topic.longest_gap)}"
    cells = (
        topic.type,
        str(topic.messages),
        words.rate(topic.rate_hz),
        period_text(topic),
        gaps,
        ", ".join(faults_of(topic)) or "none",
        "" if topic.delay is None else delay_line(topic),
    )
    return TopicRow(topic.topic, cells)


def group_words(group: GroupAnalysis, drawings: Drawings) -> GroupWords:
    """Return what is said of a group."""
    suggestion, config = group.suggestion, group.group
    topics = [topic.topic for topic in config.topics]
    rows = group.fates
    fates = tuple(fate.name for fate in FATES if any(_count(row, fate.name) for row in rows))
    verdict, tone = _verdict(group)
    curves = group.curves
    pairs = [
        PairWords(at, _pair(pair, each.outside))
        for at, (pair, each) in enumerate(zip(group.pairs, drawings.histograms, strict=True))
    ]
    seen = worth_seeing(group.pairs)
    unseen = [pair for at, pair in enumerate(group.pairs) if at not in seen]
    return GroupWords(
        name=config.name,
        policy=config.options.policy,
        sets=len(group.evaluation.sets),
        verdict=verdict,
        tone=tone,
        notes=tuple(_note(each, topics) for each in alike(group.findings)),
        hints=suggestion.hints,
        promise=promise(suggestion).removesuffix(","),
        patch=patch(suggestion.changes, {config.name: topics}).rstrip() if suggestion.changes else "",
        reasons=tuple(dict.fromkeys(f"{change.key}: {change.reason}" for change in suggestion.changes)),
        fates=fates,
        rows=tuple(_fate_row(row, fates) for row in rows),
        unneeded="; ".join(_unneeded(rows)),
        pairs=tuple(pairs[at] for at in seen),
        other_pairs=tuple(each for each in pairs if each.at not in seen),
        others=other_pairs(unseen) if unseen else "",
        by_slop=tuple(
            (slop_text(group, point), point.sets, words.duration(point.median_span) if point.sets else "")
            for point in (curves.by_slop if curves else ())
        ),
        by_queue_size=tuple(
            (size_text(group, point), point.sets) for point in (curves.by_queue_size if curves else ())
        ),
        sampled=sampled_line(curves) if curves else "",
        thinned=_thinned(drawings),
        astray=_astray(drawings),
    )


def _verdict(group: GroupAnalysis) -> tuple[str, str]:
    """Return how a group does, and the class of the style sheet for it."""
    suggestion = group.suggestion
    if not suggestion.possible:
        sets = len(group.evaluation.sets)
        return f"{counted(sets, 'set')} {'comes' if sets == 1 else 'come'} together", "ok" if sets else "error"
    share = suggestion.now / suggestion.possible
    tone = "ok" if share >= _GOOD else "warn" if suggestion.now else "error"
    return f"{suggestion.now} of {suggestion.possible} possible sets come together", tone


def _note(found: Sequence[LastingFinding], topics: Sequence[str]) -> Note:
    first, *others = found
    severity = first.finding.severity
    of = [topics[index] for each in others for index in each.finding.about]
    return Note(
        severity.name.lower(),
        _SIGNS[severity],
        severity.name.lower(),
        _told(first),
        f"likewise {all_of(of)}" if of else f"{counted(len(others), 'finding')} like it" if others else "",
        tuple(_told(each) for each in others),
    )


def _told(lasting: LastingFinding) -> str:
    return f"{in_words(lasting.finding)} (for {lasting.seconds} s of the recording)"


def _unneeded(rows: Sequence[InputFates]) -> Iterator[str]:
    """Yield why messages were not needed, inputs of one reason together."""
    of_each: dict[str, list[str]] = {}
    for row in rows:
        if row.unneeded:
            of_each.setdefault(unneeded_line(row), []).append(row.topic)
    for reason, topics in of_each.items():
        yield f"{all_of(topics)}: {reason}"


def _count(row: InputFates, fate: str) -> int:
    if fate == MATCHED:
        return row.matched
    return row.unneeded if fate == UNNEEDED else row.dropped.get(DropReason(fate), 0)


def _fate_row(row: InputFates, fates: tuple[str, ...]) -> FateRow:
    of_each = tuple(_count(row, fate) for fate in fates)
    return FateRow(row.topic, row.received, of_each, tuple(_segments(fates, of_each, row.received)))


def _segments(fates: tuple[str, ...], counts: tuple[int, ...], whole: int) -> Iterator[Segment]:
    begin = 0
    for fate, count in zip(fates, counts, strict=True):
        if count:
            yield Segment(fate, count, 100 * begin / whole, 100 * count / whole)
        begin += count


def _pair(pair: Pair, outside: int) -> str:
    return f"{pair_line(pair)}{f'; {outside} are farther off than is drawn' if outside else ''}"


def _thinned(drawings: Drawings) -> str:
    lanes = drawings.lanes
    if lanes.each == 1:
        return ""
    stretch = words.seconds(lanes.stretch)
    return (
        f"This recording has more messages than the page can hold: one of every {lanes.each} stretches of {stretch} is"
        " drawn, with all its messages. The figures and tables count every message."
    )


def _astray(drawings: Drawings) -> str:
    if not drawings.lanes.astray:
        return ""
    return (
        f"{counted(drawings.lanes.astray, 'message')} drawn at the time of receipt: unset stamps, or stamps seconds"
        " off the usual delay."
    )
