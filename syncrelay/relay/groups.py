"""The groups of the file: which of them run, and how a reload puts those of another file in their place."""

import logging
from collections.abc import Callable, Collection, Sequence
from typing import Final

from syncrelay.config import Config, ConfigError, GroupConfig
from syncrelay.config.difference import section_changes
from syncrelay.config.reload import Exchange, exchange, needs_restart
from syncrelay.dataflow.flow import Flow
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.errors import ReloadError
from syncrelay.explain import Tape
from syncrelay.relay.bindings import GroupBindings
from syncrelay.relay.bundles import Bundles
from syncrelay.relay.clock import WaitingClock
from syncrelay.relay.manifests import Manifests
from syncrelay.relay.ports import Node
from syncrelay.relay.transforms import TransformListener
from syncrelay.runtime import Runtime
from syncrelay.sync import DropReason

_LOG = logging.getLogger("syncrelay")

# Discovery takes a few tenths of a second: before that, everything would be reported as missing.
_GRACE_S: Final = 2.0
# How long an end waits for reliable subscribers to acknowledge what was published on all outputs. They do so only at
# the writer's next heartbeat, which may be 3 s away.
_ACKNOWLEDGE_NS: Final = 300_000_000


class Groups:
    """Runs the groups of a file. To be used on the main thread, except where noted."""

    def __init__(
        self,
        config: Config,
        *,
        chosen: Collection[str] | None,
        node: Node,
        bindings: GroupBindings,
        manifests: Manifests,
        bundles: Bundles,
        loop: ReceiveLoop,
        transforms: TransformListener,
        clock: WaitingClock,
        runtime: Runtime,
        flow: type[Flow],
        tape: Tape,
        changed: Callable[[Config], None],
    ) -> None:
        """Run the groups with the names `chosen`, None for all.

        `changed` is called with the file whenever other groups run.
        """
        self.config = config
        self.bindings = bindings
        self.manifests = manifests
        self.bundles = bundles
        self.reloads = 0
        self.refused_reloads = 0
        self.reload_error: str | None = None
        self.is_paused = False
        self._names = chosen
        self._node = node
        self._loop = loop
        self._transforms = transforms
        self._clock = clock
        self._runtime = runtime
        self._flow = flow
        self._tape = tape
        self._changed = changed
        # What each group waits for, as the log last said; empty for a group that runs.
        self._announced: dict[str, str] = {}
        self._started = self._runtime.monotonic()
        self._run(config)

    def reload(self, config: Config) -> str:
        """Run the groups of a file that was read again, and say what changed.

        Unchanged groups keep their queues; those that failed start again. If it raises, the groups of the file before
        keep running. It raises ReloadError for changes that need a restart and for publishers that DDS does not make,
        and ConfigError where remaps give two topics one name.
        """
        _require_same_node(self.config, config)
        require_distinct_names(config, self._names, self._node.resolve_topic)
        before = self.bindings.groups
        try:
            changed = self._run(config)
        except BaseException:
            if self.bindings.groups != before:
                self._run(self.config)
            raise
        self.config = config
        self._announced = {name: said for name, said in self._announced.items() if name in changed.kept}
        self.reloads += 1
        self.reload_error = None
        _LOG.info("%s", changed)
        return str(changed)

    def configure(self, config: Config) -> None:
        """Prepare the groups of a file that was read again: they receive and publish nothing before `begin`.

        What it raises is as for `reload`; then no groups run.
        """
        _require_same_node(self.config, config)
        require_distinct_names(config, self._names, self._node.resolve_topic)
        self.bindings.is_held = True
        self._run(config)
        self.config = config
        self.reload_error = None

    def begin(self) -> None:
        """Receive and publish, each group anew."""
        self.bindings.release()
        self._announced.clear()
        self._started = self._runtime.monotonic()
        self._run(self.config)

    def hold(self) -> None:
        """Receive and publish nothing until `begin`: what is buffered is dropped."""
        self.bindings.hold()
        self._transforms.serve(())
        self._transforms.poll()
        self._loop.call(lambda: self.flush(DropReason.SHUTDOWN)).result()
        self.wait_until_acknowledged()
        self.bindings.end_publishers()
        self._end_shared_publishers()

    def wait_until_acknowledged(self) -> None:
        """Give reliable subscribers a moment to get what was published last."""
        deadline = self._runtime.monotonic_ns() + _ACKNOWLEDGE_NS
        self.bindings.wait_until_acknowledged(deadline)
        self.bundles.wait_until_acknowledged(deadline)
        self.manifests.wait_until_acknowledged(deadline)

    def count_listeners(self) -> None:
        """Have lazy groups sleep while nobody subscribes to their outputs or manifests, which then are not made."""
        self.manifests.queue.look()
        self.bindings.count_listeners(self.manifests.publishers_of)

    def forget(self) -> None:
        """Run no groups."""
        self.bindings.run(())
        self._transforms.serve(())
        self._end_shared_publishers()
        self._loop.deadline = None
        self._changed(self.config)

    def _end_shared_publishers(self) -> None:
        """End those of bundles and manifests, which groups hand on to each other."""
        self.bundles.follow(())
        self.manifests.end_others(())

    def refuse_reload(self, reason: str) -> None:
        """Remember that a reload failed, and why."""
        self.reload_error = reason
        self.refused_reloads += 1

    def _run(self, config: Config) -> Exchange:
        running = {group.config.name: group for group in self.bindings.groups}
        self._transforms.serve(() if self.bindings.is_held else _chosen(config, self._names))
        stopped = [name for name, group in running.items() if group.failure is not None]
        chosen = _chosen(config, self._names)
        changed = exchange([group.config for group in running.values()], chosen, stopped=stopped)
        self._exchange([running[each.name] if each.name in changed.kept else self._begun(each) for each in chosen])
        limited = [(group, group.config.ticks is not None) for group in self._limited]
        # This is called at every turn. With simulated time nothing is: its ticks call `expire` instead.
        asks = bool(limited) and not self._clock.is_simulated
        self._loop.deadline = (lambda: self._next_deadline(limited)) if asks else None
        self._loop.wake()
        self._changed(config)
        return changed

    def _exchange(self, groups: Sequence[GroupRelay]) -> None:
        if self.bindings.is_held:
            self.bindings.run(groups)
            return
        self.manifests.begin(groups)
        self.bundles.begin(groups)
        try:
            self.bindings.run(groups)
        finally:
            self.bundles.follow(self.bindings.all)
            self.manifests.end_others(self.bindings.groups)
        # DDS may make some only now that others are gone.
        self.manifests.begin(groups)

    def _begun(self, config: GroupConfig) -> GroupRelay:
        now = self._clock.now if config.ticks is None else self._clock.stamping
        group = GroupRelay(config, now=now, flow=self._flow, tape=self._tape, runtime=self._runtime)
        if config.options.transforms is not None:
            group.engine = config.engine(self._transforms.frames)
        if self.is_paused:
            group.pause()
        return group

    def pause(self) -> None:
        """Let no set leave once this returns, neither of these groups nor of those that a reload brings."""
        self.is_paused = True
        self._of_each(GroupRelay.pause)
        self.manifests.queue.publish()

    def resume(self) -> None:
        """Let sets leave again."""
        self.is_paused = False
        self._of_each(GroupRelay.unpause)

    def _of_each(self, step: Callable[[GroupRelay], None]) -> None:
        """Take a step of each group between two messages."""

        def take() -> None:
            for group in self.bindings.groups:
                step(group)

        self._loop.call(take).result()

    @property
    def _limited(self) -> list[GroupRelay]:
        return [group for group in self.bindings.groups if group.config.has_deadlines]

    def announce(self) -> None:
        """Log once what each group waits for, and once that it runs."""
        if self.bindings.is_held:
            return
        for binding in self.bindings.all:
            name, waiting_for = binding.group.config.name, binding.waiting_for
            if waiting_for and self._runtime.monotonic() - self._started < _GRACE_S:
                continue
            if self._announced.get(name) == waiting_for:
                continue
            self._announced[name] = waiting_for
            # The names after all remaps, as the graph shows them.
            pairs = [(each.topic.name, self._node.resolve_topic(each.output.topic)) for each in binding.inputs]
            bundle = binding.group.config.bundle
            if bundle is not None and binding.group.config.options.outputs and binding.bundle.refusal is None:
                pairs.append(("whole sets", self._node.resolve_topic(bundle.topic)))
            flow = ", ".join(f"{topic} -> {output}" for topic, output in pairs)
            text = f"waiting for {waiting_for}" if waiting_for else f"running: {flow}"
            _LOG.info("%s: %s", name, text, extra={"group": name})

    def expire(self, now: int) -> None:
        """Have the groups give up what has waited long enough. On the loop's thread."""
        for group in self._limited:
            group.expire(now if group.config.ticks is None else self._clock.stamping())

    def transforms_came(self) -> None:
        """Have sets leave that waited for transforms. On the loop's thread."""
        now = self._clock.now()
        for group in self.bindings.groups:
            if group.config.options.transforms is not None:
                group.expire(now if group.config.ticks is None else self._clock.stamping())

    def _next_deadline(self, groups: Sequence[tuple[GroupRelay, bool]]) -> int | None:
        """Return when the first of these wants `expire` to be called, by the clock that messages wait by.

        Beside each group stands whether a clock makes its sets.
        """
        first = None
        for group, by_clock in groups:
            try:
                deadline = group.flow.engine.next_deadline()
            except Exception:  # noqa: BLE001  one call more for each group would be paid at every turn
                deadline = group.next_deadline()
            if deadline is None:
                continue
            if by_clock:
                deadline += self._clock.now() - self._clock.stamping()
            if first is None or deadline < first:
                first = deadline
        return first

    def flush(self, reason: DropReason) -> None:
        """Drop all that is buffered. On the loop's thread, or after it."""
        for group in self.bindings.groups:
            group.flush(reason)

    def clock_jumped_back(self) -> None:
        """Drop what is buffered, as the clock starts again. On any thread."""
        self._loop.call(self._flush_jump)

    def _flush_jump(self) -> None:
        # A recording that is played in a loop does this each time.
        _LOG.info("the clock jumped back, as in a looped recording; buffered messages were dropped as time_jump")
        self.flush(DropReason.TIME_JUMP)
        self._transforms.frames.clear()

    def clock_ticked(self) -> None:
        """Expire what is due by the clock. On any thread."""
        if self._limited:
            self._loop.call(lambda: self.expire(self._clock.now()))


def require_distinct_names(config: Config, chosen: Collection[str] | None, resolve: Callable[[str], str]) -> None:
    """Check the names of the chosen groups after all remaps as those of the file; raises ConfigError."""
    problems = config.names.problems(resolve, groups=[each.name for each in _chosen(config, chosen)])
    if problems:
        raise ConfigError(problems)


def _chosen(config: Config, names: Collection[str] | None) -> list[GroupConfig]:
    return [each for each in config.groups if names is None or each.name in names]


def _require_same_node(running: Config, asked: Config) -> None:
    """Raise ReloadError for what a running relay cannot change."""
    for key in needs_restart(running, asked):
        changes = ", ".join(str(each) for each in section_changes(running, asked) if each.key.split(".")[0] == key)
        raise ReloadError(f"`{key}` cannot change while the relay runs: restart it", changes=changes)
