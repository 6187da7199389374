"""Looks at the relay once a second, away from the data, and finds what there is to say of each group."""

import logging
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any, Final, NamedTuple

from syncrelay.explain import (
    Endpoint,
    FindingLog,
    GroupReport,
    GroupWatch,
    InputGraph,
    RecentDrop,
    Severity,
    Standstill,
    problems,
)
from syncrelay.ros.bugs import Bugs
from syncrelay.ros.graph import topics_alike, topics_in
from syncrelay.ros.group import Batch, GroupRelay
from syncrelay.ros.inputs import TopicInput
from syncrelay.ros.receive import ReceiveLoop
from syncrelay.ros.wirings import Wiring
from syncrelay.sync.counts import InputCounts

_LOG = logging.getLogger("syncrelay")
_LEVELS: Final = {Severity.OK: logging.INFO, Severity.WARN: logging.WARNING, Severity.ERROR: logging.ERROR}

LOOK_S: Final = 1.0
# What was lost, and what had to wait, is told as that of the last ten looks.
_LAST_LOOKS: Final = 10
# So long after a publisher was found its first messages are here.
_SETTLING_LOOKS: Final = 2
# Of many groups, so many are looked at at a time: a look at one takes some tenths of a millisecond from the data ...
_IN_TURN: Final = 10
# ... and none waits for more than so many looks: a silence is one of 5 s.
_LONGEST_TURN: Final = 4
# What sets a clock right at once, and not by making it run faster or slower.
_STEP_NS: Final = 100_000_000
_READINGS: Final = 3
# A /clock at 1 Hz stands still for a second between two ticks.
_CLOCK_STOPPED_NS: Final = 2_500_000_000


@dataclass(frozen=True, slots=True)
class _Seen:
    batch: Batch
    counts: tuple[InputCounts, ...]
    sets: int
    last: tuple[tuple[int | None, ...] | RecentDrop, ...]


class _Watched(NamedTuple):
    watch: GroupWatch
    silence: FindingLog


class _Ends(NamedTuple):
    """What the graph shows around an input of a group, beside its publishers."""

    output: str
    subscribers: tuple[Endpoint, ...]
    rivals: tuple[Endpoint, ...]
    alike: tuple[str, ...]


class Monitor:
    """Makes a report of each group that it looks at, and logs what is worth a line. On the main thread."""

    def __init__(self, wirings: Sequence[Wiring], *, node: Any, loop: ReceiveLoop, simulated: bool, bugs: Bugs) -> None:
        self._node = node
        self._loop = loop
        self._bugs = bugs
        self._clock = _ClockWatch(node) if simulated else None
        self._wirings: Sequence[Wiring] = ()
        self._watched: dict[GroupRelay, _Watched] = {}
        self._reports: dict[GroupRelay, GroupReport] = {}
        self._losses: dict[TopicInput, _Losses] = {}
        self._ends: dict[tuple[GroupRelay, int], _Ends] = {}
        self._rivals_since: dict[tuple[GroupRelay, int], int] = {}
        self._waits: dict[TopicInput, deque[int]] = {}
        self._standstills: deque[Standstill | None] = deque(maxlen=_LAST_LOOKS)
        self._standstill: Standstill | None = None
        self._wall_clock = _WallClock()
        self.watch(wirings)

    @property
    def reports(self) -> tuple[GroupReport, ...]:
        """What was found at the last look at each group, in the file's order; nothing before the first."""
        reports = self._reports
        return tuple(reports[wiring.group] for wiring in self._wirings if wiring.group in reports)

    @property
    def unjudged(self) -> tuple[str, ...]:
        """The names of the groups of which there is no report."""
        return tuple(wiring.group.config.name for wiring in self._wirings if wiring.group not in self._reports)

    def watch(self, wirings: Sequence[Wiring]) -> None:
        """Look at these groups from now on; what is known of those that were there before stays."""
        now = time.time_ns()
        self._wirings = wirings
        self._watched = {
            wiring.group: self._watched.get(wiring.group)
            or _Watched(GroupWatch(wiring.group.config, began=now), FindingLog())
            for wiring in wirings
        }
        inputs = dict.fromkeys(each for wiring in wirings for each in wiring.inputs)
        self._losses = {each: self._losses.get(each) or _Losses() for each in inputs}
        self._waits = {each: self._waits.get(each) or deque(maxlen=_LAST_LOOKS) for each in inputs}
        self._reports = {group: report for group, report in self._reports.items() if group in self._watched}
        self._ends.clear()
        self._rivals_since = {key: at for key, at in self._rivals_since.items() if key[0] in self._watched}

    def graph_changed(self) -> None:
        """Hear that what is known of the graph may no longer be so."""
        self._ends.clear()

    def overslept(self, seconds: float) -> None:
        """Hear by how much a rest was longer than it should be: the process may have stood still."""
        standstill = Standstill(time.time_ns(), round(seconds * 1e9))
        if self._standstill is None or standstill.ns > self._standstill.ns:
            self._standstill = standstill

    def look(self) -> None:
        """Look at all groups: gather, find, log. Raises CancelledError where the receive loop has ended."""
        self._look(self._wirings)

    def look_in_turn(self) -> None:
        """Look at those that were not for longest, and at all where there are new ones. Raises as `look` does."""
        if len(self._reports) < len(self._wirings):
            self._look(self._wirings)
            return
        longest_ago = sorted(self._wirings, key=lambda wiring: self._reports[wiring.group].facts.figures.now)
        self._look(longest_ago[: max(_IN_TURN, ceil(len(longest_ago) / _LONGEST_TURN))])

    def _look(self, wirings: Sequence[Wiring]) -> None:
        self._judge(wirings, *self._loop.call(lambda: self._gather(wirings)).result())

    def conclude(self) -> None:
        """Look at all groups a last time, after the receive loop has ended."""
        self._judge(self._wirings, *self._gather(self._wirings))

    def _judge(self, wirings: Sequence[Wiring], waits: Sequence[int], seen: Sequence[_Seen]) -> None:
        now = time.time_ns()
        # Receipt is by the wall clock: a step of that is no wait.
        has_stepped = self._wall_clock.has_stepped()
        for lately, waited in zip(self._waits.values(), waits, strict=True):
            lately.append(0 if has_stepped else waited)
        self._standstills.append(self._standstill)
        self._standstill = None
        stopped = self._clock.stopped_for(now) if self._clock else None
        for topic_input, losses in self._losses.items():
            losses.look(topic_input)
        for wiring, gathered in zip(wirings, seen, strict=True):
            with self._bugs.contained(f"looking at {wiring.group.config.name}"):
                try:
                    self._look_at(wiring, gathered, now, stopped)
                except Exception:
                    # Else what was found before would stand for ever.
                    self._reports.pop(wiring.group, None)
                    raise

    def _look_at(self, wiring: Wiring, gathered: _Seen, now: int, stopped: int | None) -> None:
        watch, silence = self._watched[wiring.group]
        batch = gathered.batch
        watch.add(batch.arrivals, batch.sets, gathered.counts, gathered.sets, keys=batch.keys, now=now)
        shown = [self._graph(wiring.group, index, each) for index, each in enumerate(wiring.inputs)]
        failure = wiring.group.failure
        facts = watch.facts(
            shown,
            now=now,
            clock_stopped=stopped,
            waited=max(waited for each in wiring.inputs for waited in self._waits[each]),
            standstill=max(filter(None, self._standstills), key=lambda each: each.ns, default=None),
            failure=failure,
        )
        found = problems(facts)
        self._reports[wiring.group] = GroupReport(facts, found, gathered.last)
        for remark in silence.look(facts, found):
            about = {"group": facts.name, "finding": remark.code and remark.code.value}
            _LOG.log(_LEVELS[remark.severity], "%s: %s", facts.name, remark.text, extra=about)

    def _gather(self, wirings: Sequence[Wiring]) -> tuple[list[int], list[_Seen]]:
        """Take how long messages of each input waited, and what came and left. On the loop's thread."""
        groups = [wiring.group for wiring in wirings]
        return [each.take_wait() for each in self._waits], [
            _Seen(group.watched(), group.counts(), group.engine.sets, tuple(group.last)) for group in groups
        ]

    def _graph(self, group: GroupRelay, index: int, topic_input: TopicInput) -> InputGraph:
        ends = self._ends.get((group, index))
        if ends is None:
            ends = self._ends[group, index] = self._ends_of(group, index, topic_input)
        return InputGraph(
            name=topic_input.name,
            output=ends.output,
            publishers=topic_input.publishers,
            subscribers=ends.subscribers,
            rivals=ends.rivals,
            rivals_since=self._rivals_since.get((group, index), 0),
            alike=ends.alike,
            not_importable=topic_input.not_importable,
            refusal=topic_input.refusal(group, index),
            lost=self._losses[topic_input].lately,
        )

    def _ends_of(self, group: GroupRelay, index: int, topic_input: TopicInput) -> _Ends:
        rivals = topic_input.rivals(group, index)
        if rivals:
            self._rivals_since.setdefault((group, index), time.time_ns())
        else:
            self._rivals_since.pop((group, index), None)
        return _Ends(
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


class _WallClock:
    """Sees whether the system's clock was set since it was last asked."""

    def __init__(self) -> None:
        self._offset = self._now()

    def has_stepped(self) -> bool:
        """Whether it went otherwise than time does."""
        before, self._offset = self._offset, self._now()
        return abs(self._offset - before) > _STEP_NS

    @staticmethod
    def _now() -> int:
        # Of a few readings the quickest: a thread that lost its turn between the two clocks sees a step that was none.
        return min(map(_offset, range(_READINGS)))[1]


def _offset(_: int) -> tuple[int, int]:
    """Read for how long a reading of both clocks took, and how far the system's is ahead of the other."""
    before = time.monotonic_ns()
    system = time.time_ns()
    after = time.monotonic_ns()
    return after - before, system - (before + after) // 2


class _Losses:
    """What DDS lost of a topic. Whoever begins to publish is heard from the middle on: that is no loss."""

    def __init__(self) -> None:
        self._counts: deque[int] = deque(maxlen=_LAST_LOOKS)
        self._publishers = 0
        self._unsettled = 0

    def look(self, topic_input: TopicInput) -> None:
        """Take the count of now."""
        count, publishers = topic_input.lost(), len(topic_input.publishers)
        if publishers > self._publishers or (self._counts and count < self._counts[-1]):
            self._unsettled = _SETTLING_LOOKS
        if self._unsettled:
            self._unsettled -= 1
            self._counts.clear()
        self._publishers = publishers
        self._counts.append(count)

    @property
    def lately(self) -> int:
        """How many were lost in the last ten looks."""
        return self._counts[-1] - self._counts[0] if self._counts else 0


class _ClockWatch:
    """Sees whether simulated time moves."""

    def __init__(self, node: Any) -> None:
        self._clock = node.get_clock()
        self._time = -1
        self._moved_at = time.time_ns()

    def stopped_for(self, now: int) -> int | None:
        """Return for how many nanoseconds the simulated time has stood still, None if it moves."""
        simulated = self._clock.now().nanoseconds
        if simulated != self._time:
            self._time, self._moved_at = simulated, now
        still = now - self._moved_at
        return still if still >= _CLOCK_STOPPED_NS else None
