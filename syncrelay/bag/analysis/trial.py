"""A group of a file tried on the streams: the same engine as everywhere, without reading the recording again."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from syncrelay.bag.analysis.streams import UNREADABLE, Stream
from syncrelay.config import GroupConfig
from syncrelay.explain import Code, Endpoint, Finding, GroupWatch, InputGraph, Judge, Severity
from syncrelay.sync import DropReason, InputCounts, Match, Message, Outcome

_SECOND: Final = 1_000_000_000
# What a start or an end brings, and nothing more.
_PASSING: Final = 3
# Longer than what is said of the last seconds is remembered.
_CLOSELY: Final = 16


@dataclass(frozen=True, slots=True)
class SetOut:
    """A set: its stamps in input order, when it left, its span, and how long it waited for that when complete."""

    stamps: tuple[int | None, ...]
    left: int
    span: int
    latency: int


@dataclass(frozen=True, slots=True)
class DropOut:
    """A message that left unmatched: its input, its stamp, when it was received, and why."""

    input: int
    stamp: int
    received: int
    reason: DropReason


@dataclass(frozen=True, slots=True)
class LastingFinding:
    """A finding as it last was, and for how many of the recording's seconds it held."""

    finding: Finding
    seconds: int


@dataclass(frozen=True, slots=True)
class Trial:
    """What a group makes of the streams."""

    counts: tuple[InputCounts, ...]
    sets: tuple[SetOut, ...]
    drops: tuple[DropOut, ...]


class _Run:
    """Feeds an engine from the streams in the order of the recording."""

    def __init__(self, group: GroupConfig, streams: Sequence[Stream]) -> None:
        self.group = group
        self.engine = group.engine()
        self._streams = streams
        self.sets: list[SetOut] = []
        self.drops: list[DropOut] = []
        lengths = [len(stream.places) for stream in streams]
        places = np.concatenate([stream.numbers()[2] for stream in streams])
        inputs = np.repeat(np.arange(len(streams)), lengths)
        indexes = np.concatenate([np.arange(length) for length in lengths])
        # Stable: a topic that feeds two inputs feeds them in their order.
        order = np.argsort(places, kind="stable")
        self.order: list[tuple[int, int]] = list(zip(inputs[order].tolist(), indexes[order].tolist(), strict=True))

    def feed(self, index: int, at: int) -> None:
        """Feed one message, after all that is due before it."""
        stream = self._streams[index]
        now, stamp = stream.received[at], stream.stamps[at]
        self.let_go(now)
        key = self.key(index, at)
        if stamp == UNREADABLE or (stream.keys is not None and key is None):
            self._settle([self.engine.reject(Message(index, 0, now), DropReason.MALFORMED)], now)
        else:
            self._settle(self.engine.add(Message(index, stamp, now, key), now=now), now)

    def key(self, index: int, at: int) -> Hashable:
        """Give the key of one message, None where it has none."""
        keys = self._streams[index].keys
        return None if keys is None else keys[at]

    def let_go(self, now: int) -> None:
        """Let what has waited long enough leave, each at its own time."""
        while (deadline := self.engine.next_deadline()) is not None and deadline <= now:
            self._settle(self.engine.expire(now=deadline), deadline)

    def finish(self, now: int) -> None:
        """Let all leave."""
        while (deadline := self.engine.next_deadline()) is not None:
            now = max(now, deadline)
            self._settle(self.engine.expire(now=now), now)
        self._settle(self.engine.flush(DropReason.SHUTDOWN), now)

    def _settle(self, outcomes: Sequence[Outcome], now: int) -> None:
        for outcome in outcomes:
            if isinstance(outcome, Match):
                self.sets.append(self._set(outcome, now))
            else:
                message = outcome.message
                self.drops.append(DropOut(message.input, message.stamp, message.payload, outcome.reason))

    def _set(self, match: Match, now: int) -> SetOut:
        there = [message for message in match.messages if message is not None]
        shifted = [message.stamp + self.group.topics[message.input].offset_ns for message in there]
        latency = now - max(message.payload for message in there)
        return SetOut(match.stamps, now, max(shifted) - min(shifted), latency)


def try_group(group: GroupConfig, streams: Sequence[Stream]) -> Trial:
    """Return what a group makes of the streams of its inputs."""
    run = _Run(group, streams)
    for index, at in run.order:
        run.feed(index, at)
    run.finish(max((stream.received[-1] for stream in streams if stream.received), default=0))
    return Trial(run.engine.counts(), tuple(run.sets), tuple(run.drops))


def watch_group(group: GroupConfig, streams: Sequence[Stream]) -> tuple[LastingFinding, ...]:
    """Return what the running relay would have found, looking once a second, the worst and longest first.

    However long nothing is received, it takes no more than some tens of looks.
    """
    run = _Run(group, streams)
    begin = min((stream.received[0] for stream in streams if stream.received), default=0)
    watch = _Watch(run, streams, begin)
    due = begin + _SECOND
    for index, at in run.order:
        received = streams[index].received[at]
        seconds = (received - due) // _SECOND + 1
        before = 0
        for second in looked_at(seconds):
            watch.look(due + (second - 1) * _SECOND, lasting=second - before)
            before = second
        due += before * _SECOND
        run.feed(index, at)
        if streams[index].stamps[at] != UNREADABLE:
            watch.arrivals[index].append((streams[index].stamps[at], received))
        if (key := run.key(index, at)) is not None:
            watch.keys[index] = key
    watch.look(due, lasting=1)
    lasting = [LastingFinding(finding, seconds) for finding, seconds in watch.found.values()]
    bad = [each for each in lasting if each.finding.severity is not Severity.OK and each.seconds >= _PASSING]
    return tuple(sorted(bad, key=lambda each: (-each.finding.severity, -each.seconds)))


def looked_at(seconds: int) -> list[int]:
    """Return which of so many seconds without a message are looked at: first and last ones, between ever fewer.

    When a pause begins and ends, findings come and go; one of years is as one of minutes.
    """
    first = range(1, min(seconds, _CLOSELY) + 1)
    between = (_CLOSELY << times for times in range(1, (max(0, seconds) // _CLOSELY).bit_length()))
    last = range(max(seconds - _CLOSELY, _CLOSELY) + 1, seconds + 1)
    return sorted({*first, *between, *last})


class _Watch:
    """Looks at a run, and remembers what it found, as it last was, and for how many seconds."""

    def __init__(self, run: _Run, streams: Sequence[Stream], begin: int) -> None:
        self.found: dict[tuple[Code, int | None], tuple[Finding, int]] = {}
        self.arrivals: list[list[tuple[int, int]]] = [[] for _ in streams]
        self.keys: list[Hashable] = [None] * len(streams)
        self._run = run
        self._seen = 0
        self._watch = GroupWatch(run.group, began=begin)
        self._judge = Judge()
        self._graph = [
            _graph_of(topic.topic, topic.output, topic.type, bool(stream.places))
            for topic, stream in zip(run.group.topics, streams, strict=True)
        ]

    def look(self, now: int, *, lasting: int) -> None:
        """Look at a moment that stands for so many seconds."""
        sets, engine = self._run.sets, self._run.engine
        new = [(each.stamps, each.latency) for each in sets[self._seen :]]
        self._seen = len(sets)
        self._watch.add(self.arrivals, new, engine.counts(), engine.sets, keys=tuple(self.keys), now=now)
        self.arrivals = [[] for _ in self.arrivals]
        for finding in self._judge.judge(self._watch.facts(self._graph, now=now, is_recorded=True)):
            key = (finding.code, finding.input)
            self.found[key] = (finding, self.found.get(key, (finding, 0))[1] + lasting)


def _graph_of(topic: str, output: str, type_name: str, is_recorded: bool) -> InputGraph:  # noqa: FBT001  a fact
    publishers = (Endpoint("its publisher", type_name),) if is_recorded else ()
    return InputGraph(topic, output, publishers)
