"""Evaluates groups once a second, away from the data: gathers facts, has them judged, logs what is new."""

import logging
from collections import deque
from collections.abc import Callable, Sequence
from itertools import islice
from math import ceil
from typing import TYPE_CHECKING, Final, NamedTuple

from syncrelay.dataflow.bugs import Bugs
from syncrelay.dataflow.deliveries import Deliveries
from syncrelay.dataflow.group import Batch, GroupRelay
from syncrelay.dataflow.observers import Discovery, Losses, Senders, SimulatedClock, Standstills, SystemClock, Waits
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.explain import (
    Arrivals,
    CauseLog,
    FindingLog,
    GraphSnapshot,
    GroupReport,
    GroupWatch,
    Judge,
    Pause,
    Severity,
    TryBudget,
)
from syncrelay.relay.bindings import GroupBinding
from syncrelay.relay.ports import Node, Purpose
from syncrelay.relay.surroundings import Surroundings
from syncrelay.runtime import Runtime

if TYPE_CHECKING:
    from syncrelay.relay.inputs import TopicInput

_LOG = logging.getLogger("syncrelay")
_LEVELS: Final = {Severity.OK: logging.INFO, Severity.WARN: logging.WARNING, Severity.ERROR: logging.ERROR}

EVALUATE_S: Final = 1.0
# At least this many groups are evaluated at a time: each takes up to a millisecond from the data ...
_IN_TURN: Final = 5
# ... and each is evaluated at least every fourth time: a group counts as silent after 5 s.
_LONGEST_TURN: Final = 4


class _Watched(NamedTuple):
    watch: GroupWatch
    judge: Judge
    log: FindingLog


class _Gathered(NamedTuple):
    """How long messages of each topic waited and what came of its publishers; what came and left of each group."""

    waits: Sequence[int]
    deliveries: Sequence[Sequence[Deliveries]]
    batches: Sequence[Batch]


class Monitor:
    """Makes a report of each group that it evaluates, and logs what is worth a line. On the main thread."""

    def __init__(
        self,
        *,
        node: Node,
        loop: ReceiveLoop,
        surroundings: Surroundings,
        purpose: Purpose,
        bugs: Bugs,
        runtime: Runtime,
    ) -> None:
        self._node = node
        self._runtime = runtime
        self._loop = loop
        self._is_look = purpose is Purpose.OBSERVE
        self._bugs = bugs
        self._clock = SimulatedClock(runtime=runtime) if node.is_simulated else None
        self._bindings: Sequence[GroupBinding] = ()
        self._turns: deque[GroupBinding] = deque()
        self._watched: dict[GroupRelay, _Watched] = {}
        self._reports: dict[GroupRelay, GroupReport] = {}
        self._losses: dict[TopicInput, Losses] = {}
        self._senders: dict[TopicInput, Senders] = {}
        self._surroundings = surroundings
        self._waits: dict[TopicInput, Waits] = {}
        self.standstills = Standstills(runtime=runtime)
        self._discovery = Discovery(now=runtime.monotonic())
        self._system_clock = SystemClock(runtime=runtime)
        self._try_budget = TryBudget(runtime.thread_time_ns)
        self._cause_log = CauseLog()
        self._empty_graph: GraphSnapshot | None = None
        self._ends_pauses = node.resolve_service("~/resume")
        self.inactive: str | None = None
        """The node's name, while it is managed and waits to be activated."""
        self.heard: Callable[[str, Sequence[Arrivals]], object] = lambda _group, _arrivals: None
        """Called for each group that is evaluated, with what came since: stamps and times of receipt of each input."""

    @property
    def reports(self) -> tuple[GroupReport, ...]:
        """The last report of each group, in the file's order; nothing before the first."""
        reports = self._reports
        return tuple(reports[binding.group] for binding in self._bindings if binding.group in reports)

    @property
    def unjudged(self) -> tuple[str, ...]:
        """The names of the groups that have no report."""
        return tuple(binding.group.config.name for binding in self._bindings if binding.group not in self._reports)

    @property
    def published_by(self) -> dict[str, str]:
        """Which node publishes a topic, or did when it was last seen."""
        return self._cause_log.published_by.copy()

    def watch(self, bindings: Sequence[GroupBinding]) -> None:
        """Evaluate these groups from now on; what is known of those that were there before stays."""
        now = self._runtime.time_ns()
        self._bindings = bindings
        self._turns = deque(bindings)
        self._watched = {
            binding.group: self._watched.get(binding.group)
            or _Watched(GroupWatch(binding.group.config, began=now, budget=self._try_budget), Judge(), FindingLog())
            for binding in bindings
        }
        self._cause_log.watch(binding.group.config.name for binding in bindings)
        topics = dict.fromkeys(each.topic for binding in bindings for each in binding.inputs)
        self._losses = {each: self._losses.get(each) or Losses() for each in topics}
        self._senders = {each: self._senders.get(each) or Senders() for each in topics}
        self._waits = {each: self._waits.get(each) or Waits() for each in topics}
        self._reports = {group: report for group, report in self._reports.items() if group in self._watched}
        self._surroundings.watch(each for binding in bindings for each in binding.inputs)

    def evaluate(self) -> None:
        """Evaluate all groups. Raises CancelledError where the receive loop has ended."""
        self._evaluate(self._bindings)

    def evaluate_in_turn(self) -> None:
        """Evaluate the next in turn, and all where there are new ones. Raises as `evaluate` does."""
        if len(self._reports) < len(self._bindings):
            self._evaluate(self._bindings)
            return
        # The oldest reports are not looked for by their times: the clock may be set.
        count = max(_IN_TURN, ceil(len(self._turns) / _LONGEST_TURN))
        now = [*islice(self._turns, count)]
        self._turns.rotate(-count)
        self._evaluate(now)

    def _evaluate(self, bindings: Sequence[GroupBinding]) -> None:
        gathered = self._loop.call(lambda: self._gather(bindings)).result()
        # `conclude` skips this: an end takes its time on purpose.
        self.standstills.end()
        self._judge(bindings, gathered)
        self._log()

    def conclude(self) -> None:
        """Evaluate all groups a last time, after the receive loop has ended."""
        self._judge(self._bindings, self._gather(self._bindings))
        self._log(is_last=True)

    def _judge(self, bindings: Sequence[GroupBinding], gathered: _Gathered) -> None:
        now = self._runtime.time_ns()
        self._try_budget.refill()
        # Messages are received by the system's clock: a step of it is no wait.
        has_stepped = self._system_clock.has_stepped(now)
        for recent, waited in zip(self._waits.values(), gathered.waits, strict=True):
            recent.observe(0 if has_stepped else waited)
        for (topic, senders), deliveries in zip(self._senders.items(), gathered.deliveries, strict=True):
            senders.observe(deliveries, topic.publishers)
        self.standstills.observe()
        if self._clock is not None:
            self._clock.observe(self._node.ros_time_ns(), now=now)
        for topic, losses in self._losses.items():
            # A new subscription discovers its publishers anew.
            publishers = topic.publishers if topic.entity is not None else ()
            losses.observe(topic.lost(), links=frozenset((topic.entity, each.gid) for each in publishers))
        self._empty_graph = self._surroundings.empty_graph()
        if self._discovery.goes_on(self._runtime.monotonic()):
            self._discovery.observe(self._surroundings.nodes_and_topics(), now=self._runtime.monotonic())
        for binding, batch in zip(bindings, gathered.batches, strict=True):
            with self._bugs.contained(f"evaluating {binding.group.config.name}"):
                try:
                    self._evaluate_group(binding, batch, now)
                except Exception:
                    # An old report must not be shown as if it were current.
                    self._reports.pop(binding.group, None)
                    raise

    def _evaluate_group(self, binding: GroupBinding, batch: Batch, now: int) -> None:
        watch, judge, log = self._watched[binding.group]
        by_clock = self._clock.at if self._clock and self._clock.is_steady else None
        watch.add(
            batch.arrivals,
            batch.sets,
            batch.counts,
            batch.n_sets,
            keys=batch.keys,
            by_clock=by_clock,
            woke=binding.group.woke,
            clock_set=self._system_clock.last_step(now),
            now=now,
        )
        self.heard(binding.group.config.name, batch.arrivals)
        shown = [
            self._surroundings.of(each, self._losses[each.topic], self._senders[each.topic]) for each in binding.inputs
        ]
        facts = watch.facts(
            shown,
            now=now,
            clock=self._clock.state if self._clock else None,
            clock_set=self._system_clock.last_step(now),
            waited=max(self._waits[each.topic].longest for each in binding.inputs),
            standstills=self.standstills.recent,
            failure=binding.group.failure,
            pause=None if binding.group.paused_since is None else Pause(binding.group.paused_since, self._ends_pauses),
            asleep=binding.group.sleeps,
            is_discovering=self._discovery.goes_on(self._runtime.monotonic()),
            is_look=self._is_look,
            empty_graph=None if all(each.publishers for each in shown) else self._empty_graph,
            inactive=self.inactive,
            lapses=batch.lapses,
            unheard=self._surroundings.unheard() if batch.lapses else (),
            bundle=self._surroundings.bundle_of(binding),
        )
        found = judge.judge(facts)
        self._reports[binding.group] = GroupReport(facts, found, batch.last, log)
        remarks = log.remarks(facts, found, judge.explained(facts))
        self._cause_log.hear(facts, found, remarks, now=self._runtime.monotonic_ns())

    def _log(self, *, is_last: bool = False) -> None:
        for line in self._cause_log.lines(now=self._runtime.monotonic_ns(), is_last=is_last):
            about = {
                "group": line.groups[0] if len(line.groups) == 1 else None,
                "groups": line.groups if len(line.groups) > 1 else None,
                "finding": line.code and line.code.value,
            }
            _LOG.log(_LEVELS[line.severity], "%s", line.text, extra=about)

    def _gather(self, bindings: Sequence[GroupBinding]) -> _Gathered:
        """Take what was seen of topics and groups. On the loop's thread."""
        return _Gathered(
            [each.take_wait() for each in self._waits],
            [each.deliveries() for each in self._senders],
            [binding.group.watched() for binding in bindings],
        )
