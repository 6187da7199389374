"""Evaluates groups once a second, away from the data: gathers facts, has them judged, logs what is new."""

import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any, Final, NamedTuple

from syncrelay.dataflow.bugs import Bugs
from syncrelay.dataflow.group import Batch, GroupRelay
from syncrelay.dataflow.observers import Losses, SimulatedClock, Standstills, SystemClock, Waits
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.explain import (
    Endpoint,
    FindingLog,
    GroupReport,
    GroupWatch,
    InputGraph,
    RecentDrop,
    Severity,
    problems,
)
from syncrelay.ros.graph import topics_alike, topics_in
from syncrelay.ros.inputs import TopicInput
from syncrelay.ros.wirings import Wiring
from syncrelay.sync.counts import InputCounts

_LOG = logging.getLogger("syncrelay")
_LEVELS: Final = {Severity.OK: logging.INFO, Severity.WARN: logging.WARNING, Severity.ERROR: logging.ERROR}

EVALUATE_S: Final = 1.0
# Of many groups, so many are evaluated at a time: each takes some tenths of a millisecond from the data ...
_IN_TURN: Final = 10
# ... and none waits for more than so many evaluations: a group is silent after 5 s.
_LONGEST_TURN: Final = 4


@dataclass(frozen=True, slots=True)
class _Gathered:
    batch: Batch
    counts: tuple[InputCounts, ...]
    sets: int
    last: tuple[tuple[int | None, ...] | RecentDrop, ...]


class _Watched(NamedTuple):
    watch: GroupWatch
    silence: FindingLog


class _Surroundings(NamedTuple):
    """What the graph shows around an input of a group, beside its publishers."""

    output: str
    subscribers: tuple[Endpoint, ...]
    rivals: tuple[Endpoint, ...]
    alike: tuple[str, ...]


class Monitor:
    """Makes a report of each group that it evaluates, and logs what is worth a line. On the main thread."""

    def __init__(self, wirings: Sequence[Wiring], *, node: Any, loop: ReceiveLoop, simulated: bool, bugs: Bugs) -> None:
        self._node = node
        self._loop = loop
        self._bugs = bugs
        self._clock = SimulatedClock() if simulated else None
        self._wirings: Sequence[Wiring] = ()
        self._watched: dict[GroupRelay, _Watched] = {}
        self._reports: dict[GroupRelay, GroupReport] = {}
        self._losses: dict[TopicInput, Losses] = {}
        self._surroundings: dict[tuple[GroupRelay, int], _Surroundings] = {}
        self._rivals_since: dict[tuple[GroupRelay, int], int] = {}
        self._waits: dict[TopicInput, Waits] = {}
        self.standstills = Standstills()
        self._system_clock = SystemClock()
        self.watch(wirings)

    @property
    def reports(self) -> tuple[GroupReport, ...]:
        """The last report of each group, in the file's order; nothing before the first."""
        reports = self._reports
        return tuple(reports[wiring.group] for wiring in self._wirings if wiring.group in reports)

    @property
    def unjudged(self) -> tuple[str, ...]:
        """The names of the groups that have no report."""
        return tuple(wiring.group.config.name for wiring in self._wirings if wiring.group not in self._reports)

    def watch(self, wirings: Sequence[Wiring]) -> None:
        """Evaluate these groups from now on; what is known of those that were there before stays."""
        now = time.time_ns()
        self._wirings = wirings
        self._watched = {
            wiring.group: self._watched.get(wiring.group)
            or _Watched(GroupWatch(wiring.group.config, began=now), FindingLog())
            for wiring in wirings
        }
        inputs = dict.fromkeys(each for wiring in wirings for each in wiring.inputs)
        self._losses = {each: self._losses.get(each) or Losses() for each in inputs}
        self._waits = {each: self._waits.get(each) or Waits() for each in inputs}
        self._reports = {group: report for group, report in self._reports.items() if group in self._watched}
        self._surroundings.clear()
        self._rivals_since = {key: at for key, at in self._rivals_since.items() if key[0] in self._watched}

    def graph_changed(self) -> None:
        """Forget what was known of the graph."""
        self._surroundings.clear()

    def evaluate(self) -> None:
        """Evaluate all groups. Raises CancelledError where the receive loop has ended."""
        self._evaluate(self._wirings)

    def evaluate_in_turn(self) -> None:
        """Evaluate those that were not for longest, and all where there are new ones. Raises as `evaluate` does."""
        if len(self._reports) < len(self._wirings):
            self._evaluate(self._wirings)
            return
        longest_ago = sorted(self._wirings, key=lambda wiring: self._reports[wiring.group].facts.figures.now)
        self._evaluate(longest_ago[: max(_IN_TURN, ceil(len(longest_ago) / _LONGEST_TURN))])

    def _evaluate(self, wirings: Sequence[Wiring]) -> None:
        waits, seen = self._loop.call(lambda: self._gather(wirings)).result()
        now = time.time_ns()
        # Messages are received by the system's clock: a step of it is no wait.
        has_stepped = self._system_clock.has_stepped()
        for recent, waited in zip(self._waits.values(), waits, strict=True):
            recent.observe(0 if has_stepped else waited)
        self.standstills.observe()
        stopped = self._clock.observe(self._node.get_clock().now().nanoseconds, now=now) if self._clock else None
        for topic_input, losses in self._losses.items():
            losses.observe(topic_input.lost(), publishers=len(topic_input.publishers))
        for wiring, gathered in zip(wirings, seen, strict=True):
            with self._bugs.contained(f"evaluating {wiring.group.config.name}"):
                try:
                    self._evaluate_group(wiring, gathered, now, stopped)
                except Exception:
                    # Else an old report would stand for ever.
                    self._reports.pop(wiring.group, None)
                    raise

    def _evaluate_group(self, wiring: Wiring, gathered: _Gathered, now: int, stopped: int | None) -> None:
        watch, silence = self._watched[wiring.group]
        batch = gathered.batch
        watch.add(batch.arrivals, batch.sets, gathered.counts, gathered.sets, keys=batch.keys, now=now)
        shown = [self._graph(wiring.group, index, each) for index, each in enumerate(wiring.inputs)]
        failure = wiring.group.failure
        facts = watch.facts(
            shown,
            now=now,
            clock_stopped=stopped,
            waited=max(self._waits[each].longest for each in wiring.inputs),
            standstill=self.standstills.longest,
            failure=failure,
        )
        found = problems(facts)
        self._reports[wiring.group] = GroupReport(facts, found, gathered.last)
        for remark in silence.look(facts, found):
            about = {"group": facts.name, "finding": remark.code and remark.code.value}
            _LOG.log(_LEVELS[remark.severity], "%s: %s", facts.name, remark.text, extra=about)

    def _gather(self, wirings: Sequence[Wiring]) -> tuple[list[int], list[_Gathered]]:
        """Take how long messages of each input waited, and what came and left. On the loop's thread."""
        groups = [wiring.group for wiring in wirings]
        return [each.take_wait() for each in self._waits], [
            _Gathered(group.watched(), group.counts(), group.engine.sets, tuple(group.last)) for group in groups
        ]

    def _graph(self, group: GroupRelay, index: int, topic_input: TopicInput) -> InputGraph:
        surroundings = self._surroundings.get((group, index))
        if surroundings is None:
            surroundings = self._surroundings[group, index] = self._look_around(group, index, topic_input)
        return InputGraph(
            name=topic_input.name,
            output=surroundings.output,
            publishers=topic_input.publishers,
            subscribers=surroundings.subscribers,
            rivals=surroundings.rivals,
            rivals_since=self._rivals_since.get((group, index), 0),
            alike=surroundings.alike,
            not_importable=topic_input.not_importable,
            refusal=topic_input.refusal(group, index),
            lost=self._losses[topic_input].recent,
        )

    def _look_around(self, group: GroupRelay, index: int, topic_input: TopicInput) -> _Surroundings:
        rivals = topic_input.rivals(group, index)
        if rivals:
            self._rivals_since.setdefault((group, index), time.time_ns())
        else:
            self._rivals_since.pop((group, index), None)
        return _Surroundings(
            output=self._node.resolve_topic_name(group.config.topics[index].output),
            subscribers=topic_input.subscribers(group, index),
            rivals=rivals,
            alike=() if topic_input.publishers else self._alike(topic_input),
        )

    def _alike(self, topic_input: TopicInput) -> tuple[str, ...]:
        """Find what may have been meant: our own outputs are not it."""
        outputs = {
            self._node.resolve_topic_name(topic.output)
            for wiring in self._wirings
            for topic in wiring.group.config.topics
        }
        published = [
            (name, types)
            for name, types in topics_in(self._node).items()
            if name not in outputs and self._node.count_publishers(name)
        ]
        return topics_alike(topic_input.name, topic_input.type, published)
