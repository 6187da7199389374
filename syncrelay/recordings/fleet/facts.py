"""The table of facts of a fleet: its columns, and the rows that the analysis of a recording gives.

The models here are the only source of the table's Parquet schema, of its JSON lines and of its page in docs/reference.
"""

from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta
from math import ceil
from typing import Annotated, Final

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict

from syncrelay import own_version
from syncrelay.printable import printable
from syncrelay.recordings.analysis import Analysis, Change, GroupAnalysis
from syncrelay.recordings.analysis.topics import TopicFigures, figures_of

FACTS: Final = "facts.jsonl"
"""The file with a recording's rows in the folder of its result."""

_MS: Final = 1_000_000
_SECOND: Final = 1_000_000_000
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)

Text = Annotated[str, BeforeValidator(lambda text: printable(text) if isinstance(text, str) else text)]
"""Text on one line: names in recordings may hold line breaks, control characters, and what is no Unicode."""


class _Facts(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)


class Drops(_Facts):
    """Messages that an input dropped for one reason."""

    reason: Text
    """One of the [drop reasons](drop_reasons.md)."""
    messages: int
    """How many messages were dropped for it."""


class InputFacts(_Facts):
    """One input of the group: what became of its messages, and the rhythm and clock of its topic."""

    topic: Text
    """The topic as the file names it."""
    type: Text | None
    """The message type; null if the file names none and nothing was recorded."""
    required: bool
    """Whether a set needs this input."""
    received: int
    """Messages in the recording; 0 if the topic is missing or silent."""
    matched: int
    """Messages that are in a set."""
    unneeded: int
    """Dropped messages that cost no set, because the other inputs had no partner left for them."""
    dropped: tuple[Drops, ...]
    """All dropped messages by reason, the unneeded ones among them."""
    rate_hz: float
    """Messages per second, by their stamps; by their receipt if they have none. 0 for fewer than 2 messages."""
    jitter_ms: float | None
    """95 % of the periods differ from the median period by no more than this."""
    first_s: float | None
    """Seconds from the begin of the recording to the first message."""
    last_s: float | None
    """Seconds from the begin of the recording to the last message."""
    gaps: int
    """Periods of more than 1.5 times the median period: at least one message is missing in each."""
    longest_gap_ms: float | None
    """The longest of the gaps."""
    duplicates: int
    """Messages with the stamp of another message."""
    out_of_order: int
    """Messages with an earlier stamp than the message before."""
    unstamped: int
    """Messages with stamp 0."""
    unreadable: int
    """Messages without a readable stamp."""
    delay_median_ms: float | None
    """Median time from stamp to receipt. More than a second, or less than 0, is the distance of two clocks."""
    delay_max_ms: float | None
    """Longest time from stamp to receipt."""
    drift_ppm: float | None
    """How much slower than the recorder's clock the stamps run, in parts per million; null if lost in noise."""
    distance_median_ms: float | None
    """Median distance of its messages to the nearest message of the group's other inputs, of the farthest input."""


class FindingFacts(_Facts):
    """A finding that the running relay would have reported."""

    code: Text
    """One of the [findings](findings.md)."""
    severity: Text
    """`warn` or `error`."""
    topic: Text | None
    """The topic that it is about; null if it is about the group."""
    seconds: int
    """For how many seconds of the recording it held."""
    text: Text
    """The finding's sentence, with the figures of this recording."""
    suggestion: Text | None
    """What to do."""


class SuggestedValue(_Facts):
    """A value that fits this recording better than the one in the file."""

    key: Text
    """The key of the group, or of one of its topics."""
    topic: Text | None
    """The topic whose key it is; null for a key of the group."""
    value: Text
    """The value, as it is written in the file."""


class SlopTrial(_Facts):
    """The sets that the group gives with another slop, tried with the engine."""

    slop_ms: float
    """The slop that was tried."""
    sets: int
    """Sets that came together with it."""
    of_messages: int
    """Messages of the slowest input in the trial: there cannot be more sets."""


class FleetRow(_Facts):
    """A row for each group of the file in a recording. A recording that could not be analyzed has one row."""

    recording: Text
    """Absolute path or URL of the recording."""
    robot: Text | None = None
    """The robot, taken from the path as `--robot` says; null if the path does not name one."""
    day: Text | None = None
    """The day on which the recording begins, in UTC: `2026-05-01`."""
    begin_ns: int | None = None
    """Receipt of the first message, in nanoseconds since 1970 (UTC)."""
    duration_s: float | None = None
    """Time from the first to the last message, in seconds."""
    size_bytes: int | None = None
    """Size of the recording; null if it could not be read."""
    version: Text = own_version()
    """Version of syncrelay that analyzed it."""
    file_hash: Text | None = None
    """Hash of what the file's groups say, whatever its comments, order or units; null if topics were given instead."""
    error: Text | None = None
    """Why the recording could not be analyzed; null if it could."""
    problems: tuple[Text, ...] = ()
    """What the recording lacks, and what of it is damaged or could not be read, a sentence each."""
    group_name: Text | None = None
    """Name of the group; null if the recording could not be analyzed."""
    policy: Text | None = None
    """The group's policy."""
    sets: int | None = None
    """Sets that left the group."""
    possible_sets: int | None = None
    """Sets that the recorded messages allow; null if that cannot be known, as with `equal_key`."""
    matched_sets: int | None = None
    """How many of the possible sets came together, counted before thinning."""
    share: float | None = None
    """`matched_sets / possible_sets`, 0 to 1; 0 if the group gave no set, null if possible sets are not known."""
    span_median_ms: float | None = None
    """Median span of the sets: latest minus earliest stamp of a set."""
    span_p95_ms: float | None = None
    """95th percentile of the spans."""
    span_max_ms: float | None = None
    """The widest span."""
    latency_median_ms: float | None = None
    """Median time from receiving the last message of a set to sending the set."""
    latency_p95_ms: float | None = None
    """95th percentile of the latencies."""
    latency_max_ms: float | None = None
    """The longest latency."""
    inputs: tuple[InputFacts, ...] = ()
    """The group's inputs, in the order of the file."""
    findings: tuple[FindingFacts, ...] = ()
    """What was wrong for 3 s or longer, the worst first."""
    suggestions: tuple[SuggestedValue, ...] = ()
    """Values that fit this recording better."""
    suggested_sets: int | None = None
    """How many of the possible sets come together with all suggested values."""
    slop_trials: tuple[SlopTrial, ...] = ()
    """What other slops would give, the smallest first; empty for a policy without slop."""


def rows_of(
    analysis: Analysis, *, recording: str, problems: Iterable[str], file_hash: str | None
) -> Iterator[FleetRow]:
    """Yield a row for each group of an analysis; the robot and the size are added when all rows are put together."""
    topics = {figures.topic: figures for figures in analysis.topics}
    told = tuple(problems)
    for each in analysis.groups:
        suggestion, sets = each.suggestion, each.evaluation.sets
        spans, latencies = (np.sort(each[:]).tolist() for each in (sets.spans, sets.latencies))
        yield FleetRow(
            recording=recording,
            day=_day_of(analysis.begin),
            begin_ns=analysis.begin,
            duration_s=(analysis.end - analysis.begin) / _SECOND,
            file_hash=file_hash,
            problems=told,
            group_name=each.group.name,
            policy=each.group.options.policy,
            sets=len(sets),
            possible_sets=suggestion.possible or None,
            matched_sets=suggestion.now if suggestion.possible else None,
            share=_share(suggestion.now, suggestion.possible, len(sets)),
            span_median_ms=_quantile_ms(spans, 0.5),
            span_p95_ms=_quantile_ms(spans, 0.95),
            span_max_ms=_quantile_ms(spans, 1),
            latency_median_ms=_quantile_ms(latencies, 0.5),
            latency_p95_ms=_quantile_ms(latencies, 0.95),
            latency_max_ms=_quantile_ms(latencies, 1),
            inputs=tuple(_inputs(each, topics, analysis.begin)),
            findings=tuple(_findings(each)),
            suggestions=tuple(_suggested(each, change) for change in suggestion.changes),
            suggested_sets=suggestion.then if suggestion.possible else None,
            slop_trials=tuple(_slop_trials(each)),
        )


def _day_of(nanoseconds: int) -> str | None:
    """Return the day of a time; None for one that no calendar has."""
    try:
        return f"{_EPOCH + timedelta(microseconds=nanoseconds // 1000):%Y-%m-%d}"
    except OverflowError:
        return None


def _share(now: int, possible: int, sets: int) -> float | None:
    if possible:
        return min(1.0, now / possible)
    return None if sets else 0.0


def _ms(nanoseconds: int | None) -> float | None:
    return None if nanoseconds is None else nanoseconds / _MS


def _quantile_ms(ordered: list[int], share: float) -> float | None:
    return ordered[ceil(share * len(ordered)) - 1] / _MS if ordered else None


def _inputs(each: GroupAnalysis, topics: dict[str, TopicFigures], begin: int) -> Iterator[InputFacts]:
    parts = zip(each.group.topics, each.streams, each.evaluation.counts, each.fates, strict=True)
    for topic, stream, counts, fates in parts:
        figures = topics.get(stream.topic) or figures_of(stream)
        distances = [pair.distance.median for pair in each.pairs if stream.topic in (pair.first, pair.second)]
        yield InputFacts(
            topic=topic.topic,
            type=stream.type or None,
            required=topic.required,
            received=counts.fed,
            matched=counts.matched,
            unneeded=fates.unneeded,
            dropped=tuple(Drops(reason=reason.value, messages=count) for reason, count in counts.dropped.items()),
            rate_hz=figures.rate_hz,
            jitter_ms=_ms(figures.jitter),
            first_s=(int(stream.received[0]) - begin) / _SECOND if len(stream.received) else None,
            last_s=(int(stream.received[-1]) - begin) / _SECOND if len(stream.received) else None,
            gaps=figures.gaps,
            longest_gap_ms=_ms(figures.longest_gap),
            duplicates=figures.duplicates,
            out_of_order=figures.out_of_order,
            unstamped=figures.unstamped,
            unreadable=figures.unreadable,
            delay_median_ms=_ms(figures.delay.median) if figures.delay else None,
            delay_max_ms=_ms(figures.delay.greatest) if figures.delay else None,
            drift_ppm=figures.drift_ppm,
            distance_median_ms=_ms(max(distances, default=None)),
        )


def _findings(each: GroupAnalysis) -> Iterator[FindingFacts]:
    for lasting in each.findings:
        finding = lasting.finding
        yield FindingFacts(
            code=finding.code.value,
            severity=finding.severity.name.lower(),
            topic=None if finding.input is None else each.group.topics[finding.input].topic,
            seconds=lasting.seconds,
            text=finding.text,
            suggestion=finding.suggestion,
        )


def _suggested(each: GroupAnalysis, change: Change) -> SuggestedValue:
    topic = None if change.topic is None else each.group.topics[change.topic].topic
    return SuggestedValue(key=change.key, topic=topic, value=str(change.value))


def _slop_trials(each: GroupAnalysis) -> Iterator[SlopTrial]:
    curves = each.curves
    for point in curves.by_slop if curves else ():
        yield SlopTrial(slop_ms=point.value / _MS, sets=point.sets, of_messages=curves.of if curves else 0)
