"""What the running relay would have reported of a recording: the same watch, fed by the times of receipt."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Final

from syncrelay.config import GroupConfig, TopicConfig
from syncrelay.explain import (
    UNREADABLE,
    Arrivals,
    Code,
    Endpoint,
    Finding,
    GroupWatch,
    InputGraph,
    Judge,
    Severity,
)
from syncrelay.explain.trials import Trials
from syncrelay.recordings.analysis.evaluation import Evaluation
from syncrelay.recordings.analysis.streams import Stream

_SECOND: Final = 1_000_000_000
# The start and the end of a recording bring findings that last less long.
_PASSING: Final = 3
LASTING_NS: Final = _PASSING * _SECOND
"""Findings that last less long are not told."""


@dataclass(frozen=True, slots=True)
class LastingFinding:
    """A finding as it last was, and for how many of the recording's seconds it held."""

    finding: Finding
    seconds: int


def alike(found: Sequence[LastingFinding]) -> list[list[LastingFinding]]:
    """Return findings with those that say the same of other inputs beside them; each as in the order that they have."""
    together: dict[tuple[Code, Severity], list[LastingFinding]] = {}
    for each in found:
        together.setdefault((each.finding.code, each.finding.severity), []).append(each)
    return list(together.values())


def watch_group(
    group: GroupConfig,
    streams: Sequence[Stream],
    evaluation: Evaluation,
    *,
    whole: Callable[[], Trials] | None = None,
) -> tuple[LastingFinding, ...]:
    """Return what the running relay would have found, judging at each look of an evaluation, the worst longest first.

    Where `whole` gives trials on the whole recording, the suggested values are theirs. What was wrong for no longer
    than it takes to start or to end is left out.
    """
    watch, judge = None, Judge()
    graph = [_graph(topic, stream) for topic, stream in zip(group.topics, streams, strict=True)]
    fed = [0] * len(streams)
    keys: list[Hashable] = [None] * len(streams)
    found: dict[tuple[Code, int | None], LastingFinding] = {}
    for look, sets in evaluation.seen():
        watch = watch or GroupWatch(group, began=look.at - _SECOND, whole=whole)
        came = [slice(before, counts.fed) for before, counts in zip(fed, look.counts, strict=True)]
        arrivals = [_arrivals(stream, some) for stream, some in zip(streams, came, strict=True)]
        keys = [_newest_key(stream, some, key) for stream, some, key in zip(streams, came, keys, strict=True)]
        fed = [some.stop for some in came]
        watch.add(arrivals, sets, look.counts, look.sets, keys=tuple(keys), now=look.at)
        for finding in judge.judge(watch.facts(graph, now=look.at, is_recorded=True, lapses=look.lapses)):
            key = (finding.code, finding.input)
            before = found[key].seconds if key in found else 0
            found[key] = LastingFinding(finding, before + look.seconds)
    wrong = (each for each in found.values() if each.finding.severity is not Severity.OK)
    lasting = (each for each in wrong if each.seconds >= _PASSING)
    return tuple(sorted(lasting, key=lambda each: (-each.finding.severity, -each.seconds)))


def _arrivals(stream: Stream, some: slice) -> Arrivals:
    pairs = zip(stream.stamps[some].tolist(), stream.received[some].tolist(), strict=True)
    return [pair for pair in pairs if pair[0] != UNREADABLE]


def _newest_key(stream: Stream, some: slice, before: Hashable) -> Hashable:
    """Return the newest key of some messages, that of before where none has any."""
    return next((key for key in reversed((stream.keys or [])[some]) if key is not None), before)


def _graph(topic: TopicConfig, stream: Stream) -> InputGraph:
    """Return what a recording shows around an input: that it was published."""
    publisher = Endpoint("its publisher", stream.type) if len(stream.places) else None
    return InputGraph(topic.topic, topic.output, (publisher,) if publisher else (), type_from=publisher)
