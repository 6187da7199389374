"""What the page says in words and tables, beside the figures that the template takes as they are."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

from syncrelay.config.wording import all_of, counted
from syncrelay.explain import Severity, in_words, words
from syncrelay.explain.summary import why_unneeded
from syncrelay.recordings.analysis import GroupAnalysis, patch
from syncrelay.recordings.analysis.html.drawings import Drawings
from syncrelay.recordings.analysis.pairs import worth_seeing
from syncrelay.recordings.analysis.report_text import (
    delay_line,
    faults_of,
    other_pairs,
    pair_line,
    period_text,
    promise,
)
from syncrelay.recordings.analysis.topics import TopicFigures
from syncrelay.recordings.analysis.unneeded import InputFates
from syncrelay.recordings.analysis.watching import LastingFinding, alike
from syncrelay.status.fates import FATES, MATCHED, UNNEEDED
from syncrelay.sync import DropReason

TOPIC_COLUMNS: Final = ("Type", "Messages", "Rate", "Period", "Gaps", "Faults of stamps", "Received")

_GOOD: Final = 0.99
_SIGNS: Final = {Severity.ERROR: "\N{MULTIPLICATION X}", Severity.WARN: "!"}


def topic_row(topic: TopicFigures) -> dict[str, Any]:
    """Return the figures of a topic, a cell for each of TOPIC_COLUMNS."""
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
    return {"topic": topic.topic, "cells": cells}


def group_words(group: GroupAnalysis, drawings: Drawings) -> dict[str, Any]:
    """Return a group, its lanes, and what is said of them in words."""
    suggestion, topics = group.suggestion, [topic.topic for topic in group.group.topics]
    fates = tuple(fate.name for fate in FATES if any(_count(row, fate.name) for row in group.fates))
    verdict, tone = _verdict(group)
    pairs = [
        {
            "at": at,
            "text": pair_line(pair) + (f"; {each.outside} are farther off than is drawn" if each.outside else ""),
        }
        for at, (pair, each) in enumerate(zip(group.pairs, drawings.histograms, strict=True))
    ]
    seen = worth_seeing(group.pairs)
    unseen = [at for at in range(len(pairs)) if at not in seen]
    return {
        "of": group,
        "lanes": drawings.lanes,
        "verdict": verdict,
        "tone": tone,
        "notes": [_note(each, topics) for each in alike(group.findings)],
        "promise": promise(suggestion).removesuffix(","),
        "patch": patch(suggestion.changes, {group.group.name: topics}).rstrip() if suggestion.changes else "",
        "reasons": list(dict.fromkeys(f"{change.key}: {change.reason}" for change in suggestion.changes)),
        "fates": fates,
        "rows": [_fate_row(row, fates) for row in group.fates],
        "unneeded": "; ".join(_unneeded(group.fates)),
        "mapped": [str(mapped) for mapped, _ in group.mapped],
        "pairs": [pairs[at] for at in seen],
        "other_pairs": [pairs[at] for at in unseen],
        "others": other_pairs([group.pairs[at] for at in unseen]) if unseen else "",
    }


def _verdict(group: GroupAnalysis) -> tuple[str, str]:
    """Return how a group does, and the class of the style sheet for it."""
    suggestion = group.suggestion
    if not suggestion.possible:
        sets = len(group.evaluation.sets)
        return f"{counted(sets, 'set')} {'comes' if sets == 1 else 'come'} together", "ok" if sets else "error"
    share = suggestion.now / suggestion.possible
    tone = "ok" if share >= _GOOD else "warn" if suggestion.now else "error"
    return f"{suggestion.now} of {suggestion.possible} possible sets come together", tone


def _note(found: Sequence[LastingFinding], topics: Sequence[str]) -> dict[str, Any]:
    """Return a finding with its severity as a class, a sign and a word, and those like it of other inputs."""
    texts = [f"{in_words(each.finding)} (for {each.seconds} s of the recording)" for each in found]
    severity, others = found[0].finding.severity, found[1:]
    of = [topics[index] for each in others for index in each.finding.about]
    return {
        "tone": severity.name.lower(),
        "sign": _SIGNS[severity],
        "word": severity.name.lower(),
        "text": texts[0],
        "likewise": f"likewise {all_of(of)}" if of else f"{counted(len(others), 'finding')} like it" if others else "",
        "others": texts[1:],
    }


def _unneeded(rows: Sequence[InputFates]) -> Iterator[str]:
    """Yield why messages were not needed, inputs with the same reason together."""
    of_each: dict[str, list[str]] = {}
    for row in rows:
        if row.unneeded:
            of_each.setdefault(why_unneeded(row.lacking), []).append(row.topic)
    for reason, topics in of_each.items():
        yield f"{all_of(topics)}: {reason}"


def _count(row: InputFates, fate: str) -> int:
    if fate == MATCHED:
        return row.matched
    return row.unneeded if fate == UNNEEDED else row.dropped.get(DropReason(fate), 0)


def _fate_row(row: InputFates, fates: tuple[str, ...]) -> dict[str, Any]:
    """Return where an input's messages went: a count for each fate, and the segments of a bar in percent."""
    counts = [_count(row, fate) for fate in fates]
    bar, begin = [], 0
    for fate, count in zip(fates, counts, strict=True):
        if count:
            of = row.received
            bar.append({"fate": fate, "count": count, "begin": 100 * begin / of, "width": 100 * count / of})
        begin += count
    return {"topic": row.topic, "received": row.received, "counts": counts, "bar": bar}
