"""What the running relay would have reported of a recording: the same watch, fed by the times of receipt."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Final

from syncrelay.config import GroupConfig, TopicConfig
from syncrelay.explain import (
    UNREADABLE,
    Code,
    Endpoint,
    EngineDriver,
    Finding,
    GroupWatch,
    InputGraph,
    Judge,
    Severity,
)
from syncrelay.explain.trials import Trials
from syncrelay.recordings.analysis.streams import Stream, messages, transforms_beside
from syncrelay.sync import Match, Message, Outcome

_SECOND: Final = 1_000_000_000
# The start and the end of a recording bring findings that last less long.
_PASSING: Final = 3
# Findings speak of the last seconds: fewer than these.
_CLOSELY: Final = 16
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
    *,
    until: int | None = None,
    whole: Callable[[], Trials] | None = None,
) -> tuple[LastingFinding, ...]:
    """Return what the running relay would have found, judging once a second, the worst and longest first.

    Where `whole` gives trials on the whole recording, the suggested values are theirs.

    It is judged to the last message, or `until` later than that in nanoseconds of receipt.
    However long nothing is received, that takes no more than some tens of judgements.
    """
    watch = None
    for message in messages(streams):
        if watch is None:
            watch = _Watch(group, streams, began=message.payload, whole=whole)
        watch.add(message)
    return () if watch is None else watch.lasting(until)


def judged_seconds(seconds: int) -> list[int]:
    """Return which of so many seconds without a message are judged: first and last ones, between ever fewer.

    When a pause begins and ends, findings come and go; one of years is as one of minutes.
    """
    first = range(1, min(seconds, _CLOSELY) + 1)
    between = (_CLOSELY << times for times in range(1, (max(0, seconds) // _CLOSELY).bit_length()))
    last = range(max(seconds - _CLOSELY, _CLOSELY) + 1, seconds + 1)
    return sorted({*first, *between, *last})


class _Watch:
    """Drives a group and watches it, as the running relay does; remembers each finding and for how long it held."""

    def __init__(
        self, group: GroupConfig, streams: Sequence[Stream], *, began: int, whole: Callable[[], Trials] | None
    ) -> None:
        self._sets: list[tuple[tuple[int | None, ...], int]] = []
        self._driver = EngineDriver(group, self._take, transforms_beside(streams))
        self._watch = GroupWatch(group, began=began, whole=whole)
        self._judge_of = Judge()
        self._due = began + _SECOND
        self._arrivals: list[list[tuple[int, int]]] = [[] for _ in streams]
        self._keys: list[Hashable] = [None] * len(streams)
        self._found: dict[tuple[Code, int | None], LastingFinding] = {}
        self._graph = [_graph(topic, stream) for topic, stream in zip(group.topics, streams, strict=True)]

    def _take(self, outcomes: Sequence[Outcome], now: int) -> None:
        for each in outcomes:
            if isinstance(each, Match):
                complete = max([message.payload for message in each.messages if message is not None])
                self._sets.append((each.stamps, now - complete))

    def _judge_until(self, now: int) -> None:
        """Judge the seconds that end by `now`."""
        before = 0
        for second in judged_seconds((now - self._due) // _SECOND + 1):
            self._judge(self._due + (second - 1) * _SECOND, lasting=second - before)
            before = second
        self._due += before * _SECOND

    def add(self, message: Message) -> None:
        """Judge the seconds that end by when a message was received, then add it."""
        index, stamp, received = message.input, message.stamp, message.payload
        if received >= self._due:
            self._judge_until(received)
        if message.key is not None:
            self._keys[index] = message.key
        if stamp == UNREADABLE:
            self._driver.reject(index, received, now=received)
            return
        self._driver.add(message, now=received)
        self._arrivals[index].append((stamp, received))

    def lasting(self, until: int | None) -> tuple[LastingFinding, ...]:
        """Judge to the end, and return what was wrong for longer than it takes to start or to end."""
        if until is not None and until >= self._due:
            self._judge_until(until)
        self._judge(self._due, lasting=1)
        wrong = (each for each in self._found.values() if each.finding.severity is not Severity.OK)
        lasting = (each for each in wrong if each.seconds >= _PASSING)
        return tuple(sorted(lasting, key=lambda each: (-each.finding.severity, -each.seconds)))

    def _judge(self, now: int, *, lasting: int) -> None:
        self._driver.expire(now)
        engine = self._driver.engine
        self._watch.add(self._arrivals, self._sets, engine.counts(), engine.sets, keys=tuple(self._keys), now=now)
        self._arrivals, self._sets = [[] for _ in self._arrivals], []
        for finding in self._judge_of.judge(
            self._watch.facts(self._graph, now=now, is_recorded=True, lapses=tuple(engine.lapses))
        ):
            key = (finding.code, finding.input)
            before = self._found[key].seconds if key in self._found else 0
            self._found[key] = LastingFinding(finding, before + lasting)


def _graph(topic: TopicConfig, stream: Stream) -> InputGraph:
    """Return what a recording shows around an input: that it was published."""
    publisher = Endpoint("its publisher", stream.type) if len(stream.places) else None
    return InputGraph(topic.topic, topic.output, (publisher,) if publisher else (), type_from=publisher)
