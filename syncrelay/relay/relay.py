"""The relay: a node and its threads, and what its main thread does turn by turn."""

import logging
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import CancelledError, Future
from types import TracebackType
from typing import Self, TypeVar

from syncrelay import own_version
from syncrelay.collector import resting_collector
from syncrelay.config import Config
from syncrelay.dataflow.backend import RclBackend
from syncrelay.dataflow.bugs import Bugs
from syncrelay.dataflow.calls import Calls
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.errors import ReloadError, SyncRelayError
from syncrelay.explain import GroupReport, Tape
from syncrelay.logs import name_after
from syncrelay.relay.bindings import GroupBindings
from syncrelay.relay.bundles import Bundles
from syncrelay.relay.clock import WaitingClock
from syncrelay.relay.diagnostics import Reporters
from syncrelay.relay.entities import Entities
from syncrelay.relay.groups import Groups, require_distinct_names
from syncrelay.relay.manifests import Manifests
from syncrelay.relay.monitor import EVALUATE_S, Monitor
from syncrelay.relay.ports import Node, Outcome, Purpose
from syncrelay.relay.services import Offered, Services
from syncrelay.relay.surroundings import Surroundings
from syncrelay.relay.threads import Threads
from syncrelay.relay.transforms import TransformListener, require_type
from syncrelay.runtime import SYSTEM, Runtime
from syncrelay.status import Phase, RelayState, Taps, advice
from syncrelay.sync import DropReason

_LOG = logging.getLogger("syncrelay")
_Result = TypeVar("_Result")

# The graph is polled this often while something is missing, so that a rig that starts loses little ...
_EAGER_POLL_S = 0.1
# ... and this often when nothing is missing.
_POLL_S = 1.0
# While the state is requested every second or two, all groups are evaluated every second.
_ASKED_S = 3.0
# A failure that repeats at once must not take a whole core.
_AFTER_FAILURE_S = 0.1
_ACTIVE = (Phase.STARTING, Phase.RUNNING, Phase.PAUSED)
_WITHOUT_GROUPS = (Phase.UNCONFIGURED, Phase.FINALIZED)


class Relay:
    """A node that relays the groups of a file; a context manager that runs its receive thread.

    Made on the main thread, whose turns at `step` poll the graph. Data flows on a thread of its own; the node is served
    on a third, and manifests are published on a fourth.
    """

    @resting_collector()
    def __init__(
        self,
        config: Config,
        node: Node,
        backend: RclBackend,
        *,
        config_paths: Sequence[str] = (),
        groups: Collection[str] | None = None,
        on_turn: Callable[[], None] | None = None,
        purpose: Purpose = Purpose.RELAY,
        manage: "Callable[[Relay], Callable[[str], Outcome]] | None" = None,
        runtime: Runtime = SYSTEM,
    ) -> None:
        """Take a node that has joined the graph, to leave with it; `groups` are those to run, None for all.

        A relay that only observes publishes nothing.

        `config_paths` are the files' names for `state` and a parameter. `on_turn` is called on the receive thread at
        least once a second, for as long as that works. With `manage` the node is a managed one, which starts without
        groups; it returns what carries out its transitions. Raises ConfigError where remaps give two topics one name,
        UsageError where ROS rejects what they make of one, TypeImportError where groups need transforms and the type of
        /tf is not installed.
        """
        self.node = node
        self.runtime = runtime
        try:
            require_distinct_names(config, groups, node.resolve_topic)
            require_type(each for each in config.groups if groups is None or each.name in groups)
        except SyncRelayError:
            node.leave()
            raise
        name_after(node.relay_name.removeprefix("/").replace("/", "."))
        _LOG.addHandler(node.log_handler)
        self._clock = WaitingClock(node, runtime=runtime)
        self.backend = backend.name
        self._bugs = Bugs()
        self._loop = ReceiveLoop(
            backend.inbox(),
            now=self._clock.now,
            expire=lambda now: self._groups.expire(now),  # noqa: PLW0108  the groups come after the loop
            on_turn=on_turn,
            contain=lambda error: self._bugs.log("receiving", error),
            runtime=runtime,
        )
        self._graph_changes = backend.graph_changes(node)
        entities = Entities(node, purpose)
        bindings = GroupBindings(entities=entities, node=node, backend=backend, loop=self._loop, runtime=runtime)
        self._reporters = Reporters(node, entities, now=node.ros_time_ns)
        self._names_groups = purpose is Purpose.RELAY
        if self._names_groups:
            node.declare(config_paths, own_version())
        self._surroundings = Surroundings(node, purpose, runtime=runtime)
        self.monitor = Monitor(
            node=node,
            loop=self._loop,
            surroundings=self._surroundings,
            purpose=purpose,
            bugs=self._bugs,
            runtime=runtime,
        )
        manifests = Manifests(
            entities=entities, node=node, backend=backend, loop=self._loop, bugs=self._bugs, runtime=runtime
        )
        self._manifest_queue = manifests.queue
        bundles = Bundles(entities=entities, node=node, backend=backend, loop=self._loop, runtime=runtime)
        self.taps = Taps(Tape(runtime=runtime), node.resolve_topic, runtime=runtime)
        """The clients that follow what leaves."""
        self._transforms = TransformListener(
            entities=entities,
            backend=backend,
            loop=self._loop,
            came=lambda: self._groups.transforms_came(),  # noqa: PLW0108  the groups come after it
            runtime=runtime,
        )
        self._groups = Groups(
            config,
            chosen=groups,
            node=node,
            bindings=bindings,
            manifests=manifests,
            bundles=bundles,
            loop=self._loop,
            transforms=self._transforms,
            clock=self._clock,
            runtime=runtime,
            flow=backend.flow,
            tape=self.taps.tape,
            changed=lambda config: self._report_on(bindings, config),
        )
        self._is_managed = manage is not None
        if manage is not None:
            node.manage(manage(self))
        self._config_paths = config_paths
        self._phase = Phase.STARTING if purpose is Purpose.RELAY else Phase.OBSERVING
        self._asked = -_ASKED_S
        self._started = runtime.monotonic()
        self._next_evaluation = self._started + EVALUATE_S
        self._wake = runtime.rest()
        self._calls = Calls(self._wake.set, runtime=runtime)
        self._threads = Threads(runtime)
        self._serves = True
        self._services = Services(node, {}, bugs=self._bugs, runtime=runtime)
        self._receiving: Future[None] | None = None

    def __enter__(self) -> Self:
        self._receiving = self._threads.start("receive", self._loop.run)
        self._receiving.add_done_callback(lambda _: self._wake.set())
        if self._is_managed:
            self.forget_groups(Phase.UNCONFIGURED)
            _LOG.info("%s", self._advice)
        self._threads.start("serve", self._serve)
        self._threads.start("manifests", self._manifest_queue.run)
        self._clock.follow(jumped_back=self._groups.clock_jumped_back, ticked=self._groups.clock_ticked)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def groups(self) -> tuple[str, ...]:
        """The names of the groups that run, or will once the node is active."""
        return tuple(group.config.name for group in self._groups.bindings.groups)

    @property
    def is_active(self) -> bool:
        """Whether its groups receive and publish, or are about to."""
        return self._phase in _ACTIVE

    def offer(self, services: Offered) -> None:
        """Offer services on the node. Their functions are called on its executor's thread, and must not wait."""
        self._services = Services(self.node, services, bugs=self._bugs, runtime=self.runtime)

    def reload(self, config: Config) -> str:
        """Run the groups of a file that was read again, and say what changed.

        On the main thread; raises as `Groups.reload`, and ReloadError where a managed node has no groups.
        """
        if self._phase in _WITHOUT_GROUPS:
            raise ReloadError(str(self._advice))
        changed = self._groups.reload(config)
        # New groups are to be evaluated at once.
        self._next_evaluation = self.runtime.monotonic()
        return changed

    def pause(self) -> str:
        """Let nothing leave until `resume`; say what changed. On the main thread."""
        if self._groups.is_paused:
            return "paused already"
        self._groups.pause()
        _LOG.warning("paused: nothing leaves until %s is called", self.node.resolve_service("~/resume"))
        self._show_pauses()
        return "paused: nothing leaves until ~/resume is called"

    def resume(self) -> str:
        """Let sets leave again; say what changed. On the main thread."""
        if not self._groups.is_paused:
            return "not paused"
        self._groups.resume()
        _LOG.info("resumed")
        self._show_pauses()
        return "resumed"

    def _show_pauses(self) -> None:
        with self._bugs.contained("evaluating the groups"):
            self.evaluate()

    def configure(self, config: Config) -> None:
        """Prepare the groups of a file, of a managed node that has none. On the main thread; raises as `reload`."""
        self._groups.configure(config)
        self._be_inactive()

    def activate(self) -> None:
        """Begin to receive and publish, as soon as there are publishers. On the main thread."""
        self._groups.begin()
        self.monitor.inactive = None
        self._enter(Phase.STARTING)
        self._poll_graph()

    def deactivate(self) -> tuple[GroupReport, ...]:
        """Drop what is buffered, stop receiving and publishing; report on each group. On the main thread."""
        self._groups.hold()
        self._be_inactive()
        return self.evaluate()

    def forget_groups(self, phase: Phase) -> None:
        """Run no groups from now on, in this phase. On the main thread."""
        self._groups.forget()
        self.monitor.inactive = None
        self._enter(phase)

    def _be_inactive(self) -> None:
        self.monitor.inactive = self.node.name
        self._enter(Phase.INACTIVE)

    @property
    def _advice(self) -> str | None:
        return advice(self._phase, self.node.name)

    def _enter(self, phase: Phase) -> None:
        self._phase = phase
        self._next_evaluation = self.runtime.monotonic()

    def refuse_reload(self, reason: str) -> None:
        """Report in `state` that a reload failed, and why."""
        self._groups.refuse_reload(reason)

    def _report_on(self, bindings: GroupBindings, config: Config) -> None:
        self.monitor.watch(bindings.all)
        names = [group.config.name for group in bindings.groups]
        self._reporters.configure(config, names)
        if self._names_groups:
            self.node.name_groups(names)

    def wake(self) -> None:
        """Have `step` return at once. Safe in a signal handler."""
        self._wake.set()

    def call(self, function: Callable[[], _Result]) -> "Future[_Result]":
        """Have `function` called at the next `step`; its result comes in the future. Any thread.

        A call is cancelled if the relay ends before.
        """
        return self._calls.add(function)

    def step(self, timeout_s: float = _POLL_S) -> None:
        """Poll the graph, evaluate groups, then rest until one of them is due, `timeout_s` at most, or until `wake`."""
        if self._receiving is not None and self._receiving.done():
            self._receiving.result()
        self._calls.carry_out()
        # A call may take long without holding up a message: it counts as no standstill.
        self.monitor.standstills.begin()
        with self._bugs.contained("polling the graph"):
            self._poll_graph()
            self._groups.announce()
        if (now := self.runtime.monotonic()) >= self._next_evaluation:
            with self._bugs.contained("evaluating the groups"):
                self._evaluate(self.monitor.evaluate if self._is_watched(now) else self.monitor.evaluate_in_turn)
        is_waiting = any(binding.waiting_for for binding in self._groups.bindings.all)
        until_evaluation = max(0.0, self._next_evaluation - self.runtime.monotonic())
        rest_s = min(timeout_s, until_evaluation, _EAGER_POLL_S if is_waiting else _POLL_S)
        self.monitor.standstills.end()
        self._wake.wait(rest_s)
        self.monitor.standstills.end(rest=round(rest_s * 1e9))

    def _poll_graph(self) -> None:
        has_changed = self._graph_changes.seen()
        with self._bugs.contained("counting subscribers"):
            self._groups.count_listeners()
        with self._bugs.contained("subscribing to transforms"):
            self._transforms.poll()
        for topic in self._groups.bindings.topics:
            if has_changed or topic.is_due:
                with self._bugs.contained(f"polling {topic.name}"):
                    topic.poll()
        if not self._groups.bindings.is_held:
            with self._bugs.contained("polling the bundles"):
                self._groups.bundles.follow(self._groups.bindings.all, has_changed=has_changed)
        if has_changed:
            self._surroundings.forget()

    def _is_watched(self, now: float) -> bool:
        """Whether all groups are to be evaluated every second: to plot them, or because somebody requests the state."""
        plotted = self._groups.config.diagnostics is not None and self._groups.config.diagnostics.scalars
        return plotted or now - self._asked < _ASKED_S

    def evaluate(self) -> tuple[GroupReport, ...]:
        """Evaluate all groups now, and return and publish their reports."""
        return self._evaluate(self.monitor.evaluate)

    def _evaluate(self, evaluate: Callable[[], None]) -> tuple[GroupReport, ...]:
        self._next_evaluation = self.runtime.monotonic() + EVALUATE_S
        try:
            evaluate()
        except CancelledError:
            # The receive thread has ended: the next turn raises why.
            return self.monitor.reports
        if self.is_active:
            self._phase = Phase.PAUSED if self._groups.is_paused else Phase.RUNNING
        self._reporters.publish(self.monitor.reports, advice=self._advice)
        return self.monitor.reports

    def state(self) -> RelayState:
        """The state of the relay, as last evaluated. Any thread."""
        self._asked = now = self.runtime.monotonic()
        listen = self._groups.config.listen
        return RelayState(
            node=self.node.name,
            config=", ".join(self._config_paths),
            phase=self._phase,
            uptime_s=now - self._started,
            turned_s=now - self._loop.turned,
            receives_by=self.backend.value,
            groups=self.monitor.reports,
            reloads=self._groups.reloads,
            refused_reloads=self._groups.refused_reloads,
            reload_error=self._groups.reload_error,
            unjudged=self.monitor.unjudged,
            ready_share=None if listen is None else listen.ready_share,
            published_by=self.monitor.published_by,
        )

    def drain(self) -> tuple[GroupReport, ...]:
        """Take in what has arrived, drop what is buffered, stop receiving; report on each group a last time.

        A managed node that is inactive has reported on its groups when it was deactivated: here it reports nothing.
        """
        self._calls.end()
        self._services.end()
        receiving, self._receiving = self._receiving, None
        self._phase = Phase.DRAINING
        if receiving is not None:
            self._loop.stop()
            receiving.result()
            self._groups.flush(DropReason.SHUTDOWN)
            with self._bugs.contained("ending the outputs"):
                self._groups.wait_until_acknowledged()
            self.monitor.conclude()
        return () if self._groups.bindings.is_held else self.monitor.reports

    def close(self) -> None:
        """Drain, then leave the ROS graph, also when draining fails."""
        try:
            self.drain()
        finally:
            self._clock.close()
            self._manifest_queue.stop()
            self._serves = False
            self.node.end_serving()
            self._threads.join()
            self._manifest_queue.keep(())
            self._loop.close()
            _LOG.removeHandler(self.node.log_handler)
            self.node.leave()

    def _serve(self) -> None:
        while self._serves:
            with self._bugs.contained("serving services and the clock"):
                self.node.serve()
                return
            self.runtime.sleep(_AFTER_FAILURE_S)
