"""The node: subscribes to what the file names as it appears, and keeps its groups at work."""

import gc
import logging
import os
import time
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from syncrelay.config import Config, ConfigError, GroupConfig
from syncrelay.config.wording import counted
from syncrelay.errors import ReloadError, SyncRelayError
from syncrelay.explain import GroupReport
from syncrelay.ros.bugs import Bugs
from syncrelay.ros.diagnostics import Telling
from syncrelay.ros.entities import Entities, Purpose
from syncrelay.ros.group import GroupRelay
from syncrelay.ros.logs import RosoutHandler, name_after
from syncrelay.ros.monitor import LOOK_S, Monitor
from syncrelay.ros.path_choice import VARIABLE, choose_path
from syncrelay.ros.receive import ReceiveLoop
from syncrelay.ros.start import make_node, resolver, start
from syncrelay.ros.transport import apply_transport
from syncrelay.ros.wakeup import Wakeup
from syncrelay.ros.wirings import Wiring, Wirings
from syncrelay.status import Phase, RelayState
from syncrelay.sync import DropReason

_LOG = logging.getLogger("syncrelay")

# Changes of the graph are looked for this often while something is missing, so that a rig that starts loses
# little ...
_EAGER_LOOK_S = 0.1
# ... and this often when all is there.
_LOOK_S = 1.0
# Whoever asks for the state every second or two sees all groups as of the last second.
_ASKED_S = 3.0
# Discovery takes a few tenths of a second: before that, everything would be reported as missing.
_GRACE_S = 2.0
# What a clock may fall by without being a jump: two publishers of /clock, or one that rounds.
_CLOCK_JUMP = Duration(nanoseconds=-1_000_000_000)
# What fails again at once must not take all of a core.
_AFTER_FAILURE_S = 0.1
# How long an end may take to see that reliable subscribers have what was published on all outputs. They say so
# at the writer's next heartbeat only, which may be 3 s away.
_ACKNOWLEDGE_NS = 300_000_000


class Relay:
    """A node that relays the groups of a file; a context manager that runs its receive thread.

    Made on the main thread, whose turns at `step` look at the graph. Data flows on a thread of its own;
    parameters and the clock are served on a third.
    """

    def __init__(
        self,
        config: Config,
        *,
        config_path: str = "",
        groups: Collection[str] | None = None,
        ros_args: Sequence[str] = (),
        beat: Callable[[], None] | None = None,
        purpose: Purpose = Purpose.RELAY,
    ) -> None:
        """Join the ROS graph; `groups` are the names of those to run, None for all of them.

        Whose purpose is to look has all but publishers: sets leave to nowhere.

        Raises ConfigError where remaps make the file's names meet, UsageError where ROS does not take `ros_args`.
        `config_path` is what `state` calls the file. `beat` is called on the receive thread for as long as that
        turns, once a second at least.
        """
        apply_transport(config.node.transport, os.environ)
        self._context = start(ros_args, simulated=config.node.use_sim_time)
        self.node = make_node(
            config.node.name, namespace=config.node.namespace, context=self._context, ros_args=ros_args
        )
        self._resolve = resolver(self.node, ros_args)
        self._config, self._names = config, groups
        try:
            self._require_distinct_names(config)
        except SyncRelayError:
            self._leave()
            raise
        name_after(self.node.get_logger().name)
        self._rosout = RosoutHandler(self.node.get_logger())
        _LOG.addHandler(self._rosout)
        self._sim_time = bool(self.node.get_parameter("use_sim_time").value)
        # Nanoseconds of a clock that only measures waiting: ROS time if simulated, else one that never jumps.
        self._now: Callable[[], int] = self._simulated_now if self._sim_time else time.monotonic_ns
        path = choose_path(os.environ.get(VARIABLE), node=self.node, context=self._context)
        self.receive_path = path.name
        self._bugs = Bugs()
        self._loop = ReceiveLoop(
            path.watch(),
            now=self._now,
            expire=self._expire,
            beat=beat,
            contain=lambda error: self._bugs.tell("receiving", error),
        )
        self._graph_changes = path.graph_changes(self.node)
        entities = Entities(self.node, purpose)
        self._wirings = Wirings(entities=entities, node=self.node, path=path, loop=self._loop)
        self._telling = Telling(self.node, entities)
        self.monitor = Monitor((), node=self.node, loop=self._loop, simulated=self._sim_time, bugs=self._bugs)
        self._take_on(config)
        self._reloads = 0
        self._refused_reloads = 0
        self._reload_error: str | None = None
        self._config_path = config_path
        self._phase = Phase.STARTING
        self._asked = -_ASKED_S
        self._next_look = time.monotonic() + LOOK_S
        # What each group was last said to wait for; None of one that runs.
        self._announced: dict[str, str | None] = {}
        self._started = time.monotonic()
        self._wake = Wakeup()
        self._threads = ThreadPoolExecutor(max_workers=2, thread_name_prefix="syncrelay")
        self._services = SingleThreadedExecutor(context=self._context)
        self._services.add_node(self.node)
        self._receiving: Future[None] | None = None
        self._jump_handle: Any = None

    def __enter__(self) -> Self:
        # What there is by now stays: the garbage collector need not look through all modules for each few messages.
        gc.collect()
        gc.freeze()
        self._receiving = self._threads.submit(self._loop.run)
        self._receiving.add_done_callback(lambda _: self._wake.set())
        self._threads.submit(self._serve)
        if self._sim_time:
            self._follow_clock()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def reload(self, config: Config) -> None:
        """Run the groups of a file that was read again: those that are as before go on, with all that they hold.

        A group that failed begins anew. On the main thread. Whatever it raises, the groups of the file before go on:
        ReloadError where the file asks for what needs a restart, or for a publisher that DDS does not make,
        ConfigError where remaps make its names meet.
        """
        _require_same_node(self._config, config)
        self._require_distinct_names(config)
        before = self._wirings.groups
        try:
            self._take_on(config)
        except BaseException:
            if self._wirings.groups != before:
                self._take_on(self._config)
            raise
        self._config = config
        kept = {group.config.name for group in self._wirings.groups if group in before}
        self._announced = {name: said for name, said in self._announced.items() if name in kept}
        self._reloads += 1
        self._reload_error = None
        # What is new is to be told of at once.
        self._next_look = time.monotonic()
        begin = len(self._wirings.groups) - len(kept)
        go_on = f"{counted(len(kept), 'group')} {'goes' if len(kept) == 1 else 'go'} on"
        _LOG.info("the file was read again: %s, %d %s", go_on, begin, "begins" if begin == 1 else "begin")

    def refuse_reload(self, reason: str) -> None:
        """Tell in `state` that a reload failed, and why."""
        self._reload_error = reason
        self._refused_reloads += 1

    def _chosen(self, config: Config) -> list[GroupConfig]:
        return [each for each in config.groups if self._names is None or each.name in self._names]

    def _require_distinct_names(self, config: Config) -> None:
        """Hold the names after all remaps to what is asked of a file's own; raises ConfigError."""
        problems = config.names.problems(self._resolve, groups=[each.name for each in self._chosen(config)])
        if problems:
            raise ConfigError(problems)

    def _take_on(self, config: Config) -> None:
        running = [group for group in self._wirings.groups if group.failure is None]
        chosen = self._chosen(config)
        as_before = [next((group for group in running if group.config == each), None) for each in chosen]
        self._wirings.wire(
            [group or GroupRelay(each, now=self._now) for group, each in zip(as_before, chosen, strict=True)]
        )
        limited = [group for group in self._wirings.groups if group.config.options.max_wait is not None]
        # Asked at every turn. Simulated time does not pass while the loop sleeps: its ticks call expire instead.
        self._loop.deadline = None if self._sim_time or not limited else lambda: _next_deadline(limited)
        self._loop.wake()
        self.monitor.watch(self._wirings.all)
        self._telling.adopt(config, [group.config.name for group in self._wirings.groups])

    def wake(self) -> None:
        """Have `step` return at once. Safe in a signal handler."""
        self._wake.set()

    def step(self, timeout_s: float = _LOOK_S) -> None:
        """Look at the graph, then rest until the next look is due, `timeout_s` at most, or until `wake`."""
        if self._receiving is not None and self._receiving.done():
            self._receiving.result()
        with self._bugs.contained("looking at the graph"):
            self._look_at_graph()
            self._announce()
        if (now := time.monotonic()) >= self._next_look:
            with self._bugs.contained("looking at the groups"):
                self._look(self.monitor.look if self._is_watched(now) else self.monitor.look_in_turn)
        is_waiting = any(wiring.waiting_for for wiring in self._wirings.all)
        until_look = max(0.0, self._next_look - time.monotonic())
        rest_s, began = min(timeout_s, until_look, _EAGER_LOOK_S if is_waiting else _LOOK_S), time.monotonic()
        self._wake.wait(rest_s)
        self.monitor.overslept(time.monotonic() - began - rest_s)

    def _look_at_graph(self) -> None:
        has_changed = self._graph_changes.seen()
        for topic_input in self._wirings.inputs:
            if has_changed or topic_input.is_due:
                with self._bugs.contained(f"looking at {topic_input.name}"):
                    topic_input.look()
        if has_changed:
            self.monitor.graph_changed()

    def _is_watched(self, now: float) -> bool:
        """Whether somebody wants all groups every second: who plots them, or asks for the state."""
        plotted = self._config.diagnostics is not None and self._config.diagnostics.scalars
        return plotted or now - self._asked < _ASKED_S

    def look(self) -> tuple[GroupReport, ...]:
        """Look at all groups now, tell of it, and give what there is to say."""
        return self._look(self.monitor.look)

    def _look(self, look: Callable[[], None]) -> tuple[GroupReport, ...]:
        self._next_look = time.monotonic() + LOOK_S
        try:
            look()
        except CancelledError:
            # The receive thread has ended: the next turn raises why.
            return self.monitor.reports
        self._phase = Phase.RUNNING
        self._telling.publish(self.monitor.reports)
        return self.monitor.reports

    def state(self) -> RelayState:
        """What there is to tell of the relay, as of its last look. Any thread."""
        self._asked = now = time.monotonic()
        return RelayState(
            node=self.node.get_fully_qualified_name(),
            config=self._config_path,
            phase=self._phase,
            uptime_s=now - self._started,
            turned_s=now - self._loop.turned,
            receives_by=self.receive_path.value,
            groups=self.monitor.reports,
            reloads=self._reloads,
            refused_reloads=self._refused_reloads,
            reload_error=self._reload_error,
            unjudged=self.monitor.unjudged,
        )

    def drain(self) -> tuple[GroupReport, ...]:
        """Take in what has arrived, let go of what is buffered, stop receiving; report on each group a last time."""
        receiving, self._receiving = self._receiving, None
        self._phase = Phase.DRAINING
        if receiving is not None:
            self._loop.stop()
            receiving.result()
            for group in self._wirings.groups:
                group.flush(DropReason.SHUTDOWN)
            deadline = time.monotonic_ns() + _ACKNOWLEDGE_NS
            for topic_input in self._wirings.inputs:
                with self._bugs.contained(f"ending {topic_input.name}"):
                    topic_input.wait_until_acknowledged(deadline)
            self.monitor.conclude()
        return self.monitor.reports

    def close(self) -> None:
        """Drain, then leave the ROS graph, also when draining fails."""
        try:
            self.drain()
        finally:
            self._leave_graph()

    def _leave_graph(self) -> None:
        if self._jump_handle is not None:
            self._jump_handle.unregister()
        self._services.shutdown()
        self._threads.shutdown()
        self._loop.close()
        _LOG.removeHandler(self._rosout)
        self._leave()

    def _leave(self) -> None:
        self.node.destroy_node()
        self._context.try_shutdown()

    def _flow(self, wiring: Wiring) -> str:
        """The names after all remaps: those that the graph shows."""
        topics = zip(wiring.inputs, wiring.group.config.topics, strict=True)
        return ", ".join(f"{each.name} -> {self.node.resolve_topic_name(topic.output)}" for each, topic in topics)

    def _serve(self) -> None:
        while self._context.ok():
            with self._bugs.contained("serving parameters and the clock"), suppress(ExternalShutdownException):
                self._services.spin()
                return
            time.sleep(_AFTER_FAILURE_S)

    def _follow_clock(self) -> None:
        clock = self.node.get_clock()
        forward = Duration(nanoseconds=1)
        threshold = JumpThreshold(min_forward=forward, min_backward=_CLOCK_JUMP, on_clock_change=True)

        def changed(jump: Any) -> None:
            if jump.delta <= _CLOCK_JUMP:
                self._loop.call(self._flush_jump)
            elif any(group.config.options.max_wait is not None for group in self._wirings.groups):
                self._loop.call(lambda: self._expire(self._now()))

        self._jump_handle = clock.create_jump_callback(threshold, post_callback=changed)

    def _flush_jump(self) -> None:
        _LOG.warning("the clock jumped back: everything buffered is dropped as time_jump")
        for group in self._wirings.groups:
            group.flush(DropReason.TIME_JUMP)

    def _simulated_now(self) -> int:
        return int(self.node.get_clock().now().nanoseconds)

    def _expire(self, now: int) -> None:
        for group in self._wirings.groups:
            group.expire(now)

    def _announce(self) -> None:
        """Say once what each group waits for, and once that it runs."""
        for wiring in self._wirings.all:
            name, waiting_for = wiring.group.config.name, wiring.waiting_for
            if waiting_for and time.monotonic() - self._started < _GRACE_S:
                continue
            if name in self._announced and self._announced[name] == waiting_for:
                continue
            self._announced[name] = waiting_for
            text = f"waiting for {waiting_for}" if waiting_for else f"running: {self._flow(wiring)}"
            _LOG.info("%s: %s", name, text, extra={"group": name})


def _require_same_node(running: Config, asked: Config) -> None:
    """Raise ReloadError for what a running relay cannot take on."""
    for name, before, now in (
        ("node", running.node, asked.node),
        ("metrics", running.listen, asked.listen),
    ):
        if before != now:
            raise ReloadError(f"`{name}` cannot change while the relay runs: restart it")


def _next_deadline(groups: Sequence[GroupRelay]) -> int | None:
    try:
        deadlines = [group.engine.next_deadline() for group in groups]
    except Exception:  # noqa: BLE001  one call more for each group would be paid at every turn
        deadlines = [group.next_deadline() for group in groups]
    return min((deadline for deadline in deadlines if deadline is not None), default=None)
