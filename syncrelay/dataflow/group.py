"""One group at work: payloads in, matched sets out on the group's publishers. Lives on the receive thread."""

import logging
from collections import deque
from collections.abc import Callable, Hashable, Mapping
from contextlib import suppress
from typing import NamedTuple, TypeVar

from syncrelay.cdr_assembly import UnfitError
from syncrelay.clock import Step
from syncrelay.config import GroupConfig
from syncrelay.config.installed import policy_name, suspects
from syncrelay.dataflow.backend import Outlet, PublishError
from syncrelay.dataflow.bundle import Bundle, BundleOutlet
from syncrelay.dataflow.engines import PausedEngine, StoppedEngine
from syncrelay.dataflow.flow import Engine, Flow, Refusals, Unpublished
from syncrelay.dataflow.manifest_queue import GroupManifests
from syncrelay.explain import Code, RecentDrop, Stamps, Tape, words
from syncrelay.runtime import SYSTEM, Runtime
from syncrelay.sync import DropReason, Lapse, SyncGroup
from syncrelay.sync.counts import InputCounts

_LOG = logging.getLogger("syncrelay")
_Result = TypeVar("_Result")

# What is held while a group is suspended, which takes some tenths of a second.
_HELD = 10_000
# In nanoseconds.
_SAID_AGAIN = 10_000_000_000


class Batch(NamedTuple):
    """What came and left since the last evaluation, oldest first.

    `arrivals` are stamps and times of receipt of each input, `sets` the sets' stamps and their latencies, `keys` what
    the newest messages are matched by, `lapses` the last sets that could not be transformed, `last` what left last of
    all; times in nanoseconds. `counts` and `n_sets` are those since the group began.
    """

    arrivals: tuple[deque[tuple[int, int]], ...]
    sets: deque[tuple[Stamps, int]]
    keys: tuple[Hashable, ...]
    counts: tuple[InputCounts, ...]
    n_sets: int
    lapses: tuple[Lapse, ...]
    last: tuple[Stamps | RecentDrop, ...]


class DeviceSteps:
    """Says that a device's clock stepped, once in a while: of two clocks in turn, each message is a step."""

    def __init__(self, group: str, topic: str) -> None:
        self._group, self._topic = group, topic
        self._said = 0

    def say(self, step: Step) -> None:
        """Say it, if that was not said lately."""
        if abs(step.at - self._said) < _SAID_AGAIN:
            return
        self._said = step.at
        _LOG.warning(
            "%s: stamps of %s jumped %s by %s against this machine's clock, and are mapped anew from here: "
            "one of the two clocks was set, or the device started again",
            self._group,
            self._topic,
            "forward" if step.by > 0 else "back",
            words.span_of_time(abs(step.by)),
            extra={"group": self._group, "finding": Code.CLOCK_STEP.value},
        )


class GroupRelay:
    """Feeds a group's engine and publishes the sets that it gives, by its flow.

    An exception stops this group and no other. The handlers that feed the flow call `fail`; the methods here do so
    themselves.
    """

    def __init__(
        self,
        config: GroupConfig,
        *,
        now: Callable[[], int],
        flow: Callable[..., Flow] = Flow,
        tape: Tape | None = None,
        runtime: Runtime = SYSTEM,
    ) -> None:
        """Have `flow` make its flow, from what Flow takes but the runtime, which each backend has for itself."""
        self.config = config
        self._n_inputs = len(config.topics)
        self._refusals = Refusals(config.name)
        self.flow = flow(config, now=now, refusals=self._refusals, tape=tape or Tape(runtime=runtime))
        self.clocks = tuple(topic.device_clock(DeviceSteps(config.name, topic.topic).say) for topic in config.topics)
        """What maps the stamps of each input to the host's time; None where they are of it."""
        self.failure: str | None = None
        """What stopped it; None while it works."""
        self.paused_since: int | None = None
        """Since when it is paused, in nanoseconds of the system clock; None while it is not."""
        self.sleeps = False
        """Whether it is fed nothing, because nobody subscribes to its outputs."""
        self.woke: int | None = None
        """When it was last fed again after a sleep, by the system clock in nanoseconds."""
        self._now = now
        self._runtime = runtime
        self._suspended = self.engine
        self._held_by = StoppedEngine(0, ())
        self._was_connected: list[bool] = []
        self._manifests: GroupManifests | None = None

    @property
    def unpublished(self) -> Mapping[int, Unpublished]:
        """The inputs of which the last message could not be published."""
        return self.flow.unpublished

    @property
    def engine(self) -> Engine:
        """What its messages are fed to."""
        return self.flow.engine

    @engine.setter
    def engine(self, engine: Engine) -> None:
        self.flow.engine = engine

    def connect(self, index: int, outlet: Outlet, *, restamped: bool) -> None:
        """Publish one input's messages through an outlet from now on.

        `restamped` says that its payloads begin with a Header, whose stamp the set's common stamp replaces.
        """
        # An output numbers its messages anew from here. Readers join sets by these numbers, so they must first get the
        # manifests of the sets before.
        if self._manifests is not None:
            self._manifests.publish_noted()
        self.flow.outlets[index] = outlet
        self.flow.restamped[index] = restamped

    @property
    def bundle_index(self) -> int:
        """What stands for its bundles in `unpublished`, where inputs stand by their index."""
        return self._n_inputs

    def connect_bundle(self, bundle: Bundle, outlet: Outlet) -> None:
        """Publish its sets as one message each too, through an outlet, from now on."""
        if self._manifests is not None:
            self._manifests.publish_noted()
        is_alone = not self.config.options.outputs
        self.flow.bundle = BundleOutlet(bundle, outlet, self._note_bundle)
        self._refusals.unpublished.pop(self.bundle_index, None)
        if is_alone:
            self.flow.restamped = list(bundle.restamped)

    def disconnect_bundle(self, why: str) -> None:
        """Publish no bundles from now on, for this reason."""
        self.flow.bundle = None
        self._refusals.unpublished[self.bundle_index] = Unpublished(0, why)

    def _note_bundle(self, outlet: Outlet, error: UnfitError | PublishError | None) -> None:
        if error is not None:
            is_unfit = isinstance(error, UnfitError)
            self._refusals.refused(self.bundle_index, outlet, str(error), is_unfit=is_unfit)
        elif self.unpublished:
            self._refusals.accepted(self.bundle_index, outlet)

    def pause(self) -> None:
        """Let nothing leave until `unpause`; what is buffered, and what comes meanwhile, is dropped as `paused`."""
        if self.paused_since is not None:
            return
        self.paused_since = self._runtime.time_ns()
        self._guarded(lambda: self.flow.conclude(self.engine.let_go(DropReason.PAUSED)))
        if isinstance(self.engine, SyncGroup):
            self.engine = PausedEngine(self.engine, held=self.config.held)

    def unpause(self) -> None:
        """Match what comes from now on. No set is older than those before the pause."""
        self.paused_since = None
        if isinstance(self.engine, PausedEngine):
            self.engine = self.engine.engine
            self.engine.pass_over(now=self._now())

    def tell_sets(self, manifests: GroupManifests) -> None:
        """Have a manifest published of each set from now on, while anyone subscribes to it."""
        self._manifests = self.flow.manifests = manifests

    def suspend(self) -> None:
        """Hold new messages and let no set leave until `resume`; the outlets are forgotten, so they may end now."""
        counts = self.counts()
        self._suspended = self.engine
        self.engine = self._held_by = StoppedEngine(self.engine.sets, counts, most=_HELD)
        self._was_connected = [outlet is not None for outlet in self.flow.outlets]
        self.flow.outlets = [None] * self._n_inputs

    def resume(self) -> None:
        """Go on with the messages that were held. If an outlet is missing now, drop them: sets would lack a message."""
        if self.failure is not None:
            return
        self.engine = self._suspended
        lacks = any(
            was_connected and outlet is None
            for was_connected, outlet in zip(self._was_connected, self.flow.outlets, strict=True)
        )
        if lacks:
            self.flush(DropReason.SHUTDOWN)
        try:
            for message, held_for in self._held_by.held:
                reason = DropReason.SHUTDOWN if lacks else held_for
                if reason is not None:
                    self.flow.conclude((self.engine.reject(message, reason),))
                else:
                    self.flow.conclude(self.engine.add(message, now=self._now()))
        except Exception as error:  # noqa: BLE001  it is this group's alone
            self.fail(error)

    def sleep(self) -> None:
        """Drop all that is buffered: nothing more is fed until `wake`."""
        self.sleeps = True
        self.flush(DropReason.SHUTDOWN)

    def wake(self) -> None:
        """Be fed again."""
        self.sleeps, self.woke = False, self._runtime.time_ns()

    def watched(self) -> Batch:
        """Give what came and left since this was last asked for, and all counts."""
        flow = self.flow
        arrivals, sets = flow.watched()
        return Batch(
            arrivals,
            sets,
            tuple(flow.keys),
            self.counts(),
            self.engine.sets,
            tuple(self.engine.lapses),
            tuple(flow.last),
        )

    def expire(self, now: int) -> None:
        """Let go what has waited long enough."""
        self._guarded(lambda: self.flow.conclude(self.engine.expire(now=now)))

    def flush(self, reason: DropReason) -> None:
        """Drop all that is buffered."""
        self._guarded(lambda: self.flow.conclude(self.engine.flush(reason)))

    def next_deadline(self) -> int | None:
        """When `expire` wants to be called next."""
        return self._guarded(lambda: self.engine.next_deadline())  # noqa: PLW0108  the engine of the second time

    def counts(self) -> tuple[InputCounts, ...]:
        """Where the messages of each input went."""
        return self._guarded(lambda: self.engine.counts())  # noqa: PLW0108  as above

    def _guarded(self, step: Callable[[], _Result]) -> _Result:
        """Take a step. If it fails, stop the group, and take the step again with the engine that stands in."""
        try:
            return step()
        except Exception as error:  # noqa: BLE001  it is this group's alone
            self.fail(error)
            return step()

    def fail(self, error: Exception) -> None:
        """Stop for good, and say so once, with the traceback."""
        if self.failure is not None:
            return
        self.failure = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        _LOG.error(
            "%s: a bug in %s stopped this group; other groups keep running. "
            "Please report it with these lines and your file",
            self.config.name,
            suspects(policy_name(type(self.config.options))),
            exc_info=error,
            extra={"group": self.config.name, "finding": Code.INTERNAL_ERROR.value},
        )
        self.engine = StoppedEngine(self.engine.sets, self._last_counts())

    def _last_counts(self) -> tuple[InputCounts, ...]:
        """Count once more, as far as the engine that failed still can."""
        with suppress(Exception):
            self.engine.flush(DropReason.SHUTDOWN)
        with suppress(Exception):
            return self.engine.counts()
        return self.config.engine().counts()
