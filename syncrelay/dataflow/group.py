"""One group at work: payloads in, matched sets out on the group's publishers. Lives on the receive thread."""

import logging
import time
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from contextlib import suppress
from typing import Any, Final, NamedTuple, TypeAlias, TypeVar

from syncrelay.config import GroupConfig
from syncrelay.config.wording import counted
from syncrelay.dataflow.backend import Outlet, PublishError
from syncrelay.dataflow.engines import PausedEngine, StoppedEngine
from syncrelay.dataflow.manifest import Note
from syncrelay.dataflow.manifest_queue import GroupManifests
from syncrelay.explain import Code, RecentDrop
from syncrelay.sync import Drop, DropReason, Match, Message, SyncGroup
from syncrelay.sync.counts import InputCounts

_LOG = logging.getLogger("syncrelay")
_Result = TypeVar("_Result")
_Engine: TypeAlias = SyncGroup | PausedEngine | StoppedEngine

# Enough for the widest terminal's strip of recent sets.
_RECENT = 256
# What is kept between two evaluations: at 1 kHz they may be 10 s apart.
_WATCHED = 10_000
# What is held while a group is suspended, which takes some tenths of a second.
_HELD = 10_000
_NONE_UNPUBLISHED: Final[dict[int, str]] = {}


class Batch(NamedTuple):
    """What came and left since the last evaluation, oldest first.

    `arrivals` are stamps and times of receipt of each input, `sets` the sets' stamps and their latencies, `keys` what
    the newest messages are matched by, `last` what left last of all; times in nanoseconds. `counts` and `n_sets` are
    those since the group began.
    """

    arrivals: tuple[deque[tuple[int, int]], ...]
    sets: deque[tuple[tuple[int | None, ...], int]]
    keys: tuple[Hashable, ...]
    counts: tuple[InputCounts, ...]
    n_sets: int
    last: tuple[tuple[int | None, ...] | RecentDrop, ...]


class Unpublished(NamedTuple):
    """How many messages of an input could not be published one after the other, and why the last one could not."""

    messages: int
    why: str


class GroupRelay:
    """Feeds a group's engine and publishes the sets that it gives.

    An exception stops this group and no other: the caller of `receive` calls `fail`, all else does so itself.
    """

    def __init__(self, config: GroupConfig, *, now: Callable[[], int]) -> None:
        self.config = config
        self.engine: _Engine = config.engine()
        self.failure: str | None = None
        """What stopped it; None of one that works."""
        self.paused_since: int | None = None
        """Since when it is paused, in nanoseconds of the system clock; None of one that is not."""
        self.last: deque[tuple[int | None, ...] | RecentDrop] = deque(maxlen=_RECENT)
        """What left last, oldest first; of a set the stamps alone, as one is noted for each."""
        self.sleeps = False
        """Whether nothing is fed, because nobody listens."""
        self.woke: int | None = None
        """When it was last fed again after a sleep, by the system clock in nanoseconds."""
        self.unpublished: dict[int, Unpublished] = {}
        """The inputs of which the last message could not be published."""
        self._now = now
        self._n_inputs = len(config.topics)
        self._keys: list[Hashable] = [None] * self._n_inputs
        self._watch()
        self._restamped = [False] * len(config.topics)
        self._outlets: list[Outlet | None] = [None] * len(config.topics)
        self._suspended: _Engine = self.engine
        self._held_by = StoppedEngine(0, ())
        self._was_connected: list[bool] = []
        self._left = 0
        self._manifests: GroupManifests | None = None

    def connect(self, index: int, outlet: Outlet, *, restamped: bool) -> None:
        """Publish one input's messages through an outlet from now on.

        `restamped` says that its payloads begin with a Header, whose stamp the set's common stamp replaces.
        """
        # Whoever joins by them forgets what an output gave before it numbers anew.
        if self._manifests is not None:
            self._manifests.publish_noted()
        self._outlets[index] = outlet
        self._restamped[index] = restamped

    def pause(self) -> None:
        """Let nothing leave until `unpause`; what is buffered, and what comes meanwhile, is dropped as `paused`."""
        if self.paused_since is not None:
            return
        self.paused_since = time.time_ns()
        self._guarded(lambda: self._conclude(self.engine.let_go(DropReason.PAUSED)))
        if isinstance(self.engine, SyncGroup):
            self.engine = PausedEngine(self.engine, trigger=self.config.trigger)

    def unpause(self) -> None:
        """Match what comes from now on. No set is older than those before the pause."""
        self.paused_since = None
        if isinstance(self.engine, PausedEngine):
            self.engine = self.engine.engine

    def tell_sets(self, manifests: GroupManifests) -> None:
        """Have a manifest published of each set from now on, while anyone subscribes to it."""
        self._manifests = manifests

    def suspend(self) -> None:
        """Let nothing leave and forget the outlets, which may end now, until `resume`; what comes is held meanwhile."""
        counts = self.counts()
        self._suspended = self.engine
        self.engine = self._held_by = StoppedEngine(self.engine.sets, counts, most=_HELD)
        self._outlets, self._was_connected = [None] * self._n_inputs, [outlet is not None for outlet in self._outlets]

    def resume(self) -> None:
        """Go on with all that was held. Where an outlet is missing now, all is dropped: sets would lack a message."""
        if self.failure is not None:
            return
        self.engine = self._suspended
        lacks = any(
            was_connected and outlet is None
            for was_connected, outlet in zip(self._was_connected, self._outlets, strict=True)
        )
        if lacks:
            self.flush(DropReason.SHUTDOWN)
        try:
            for message, reason in self._held_by.held:
                self._conclude(self._resumed(message, DropReason.SHUTDOWN if lacks else reason))
        except Exception as error:  # noqa: BLE001  it is this group's alone
            self.fail(error)

    def sleep(self) -> None:
        """Drop all that is buffered: nothing more is fed until `wake`."""
        self.sleeps = True
        self.flush(DropReason.SHUTDOWN)

    def wake(self) -> None:
        """Be fed again."""
        self.sleeps, self.woke = False, time.time_ns()

    def _resumed(self, message: Message, reason: DropReason | None) -> Sequence[Match | Drop]:
        if reason is not None:
            return (self.engine.reject(message, reason),)
        return self.engine.add(message, now=self._now())

    def receive(self, index: int, payload: Any, received: int, stamp: int | None, key: Hashable = None) -> None:
        """Take in a message of one input, whose stamp is None where it, or the key, cannot be read; times in ns."""
        if stamp is None:
            self._conclude([self.engine.reject(Message(index, 0, (payload, received)), DropReason.MALFORMED)])
            return
        self._arrivals[index].append((stamp, received))
        self._keys[index] = key
        self._conclude(self.engine.add(Message(index, stamp, (payload, received), key), now=self._now()))

    def watched(self) -> Batch:
        """Give what came and left since this was last asked for, and all counts."""
        arrivals, sets = self._arrivals, self._sets
        self._watch()
        return Batch(arrivals, sets, tuple(self._keys), self.counts(), self.engine.sets, tuple(self.last))

    def _watch(self) -> None:
        # To make them by way of their generic types takes several times as long.
        self._arrivals: tuple[deque[tuple[int, int]], ...] = tuple([deque(maxlen=_WATCHED) for _ in self._keys])
        self._sets: deque[tuple[tuple[int | None, ...], int]] = deque(maxlen=_WATCHED)

    def expire(self, now: int) -> None:
        """Let go what has waited long enough."""
        self._guarded(lambda: self._conclude(self.engine.expire(now=now)))

    def flush(self, reason: DropReason) -> None:
        """Drop all that is buffered."""
        self._guarded(lambda: self._conclude(self.engine.flush(reason)))

    def next_deadline(self) -> int | None:
        """When `expire` wants to be called next."""
        return self._guarded(lambda: self.engine.next_deadline())  # noqa: PLW0108  the engine of the second time

    def counts(self) -> tuple[InputCounts, ...]:
        """Where the messages of each input went."""
        return self._guarded(lambda: self.engine.counts())  # noqa: PLW0108  as above

    def _guarded(self, step: Callable[[], _Result]) -> _Result:
        """Take a step; one that fails stops the group, and is taken again with the engine that gives nothing."""
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
            "%s: a bug in syncrelay stopped this group; other groups keep running. "
            "Please report it with these lines and your file",
            self.config.name,
            exc_info=error,
            extra={"group": self.config.name, "finding": Code.INTERNAL_ERROR.value},
        )
        self.engine = StoppedEngine(self.engine.sets, self._last_counts())

    def _last_counts(self) -> tuple[InputCounts, ...]:
        """Count once more, as far as what failed still can."""
        with suppress(Exception):
            self.engine.flush(DropReason.SHUTDOWN)
        with suppress(Exception):
            return self.engine.counts()
        return self.config.engine().counts()

    def _conclude(self, outcomes: Sequence[Match | Drop]) -> None:
        for outcome in outcomes:
            if isinstance(outcome, Match):
                newest = self._send(outcome)
                stamps, latency = outcome.stamps, time.time_ns() - newest
                self._sets.append((stamps, latency))
                self.last.append(stamps)
                self._left += 1
                if self._manifests is not None and self._manifests.is_heard:
                    self._manifests.note(self._note(outcome, stamps, latency))
            else:
                message = outcome.message
                self.last.append(RecentDrop(message.input, message.stamp, outcome.reason))

    def _send(self, match: Match) -> int:
        """Publish a set; when its newest message was received."""
        newest = 0
        for message in match.messages:
            if message is None:
                continue
            # As it was fed: what DDS received, and when, in nanoseconds of the system clock.
            payload, received = message.payload
            newest = max(newest, received)
            outlet = self._outlets[message.input]
            if outlet is None:
                continue
            try:
                if match.stamp is not None and self._restamped[message.input]:
                    outlet.send_stamped(payload, match.stamp)
                else:
                    outlet.send(payload)
            except PublishError as error:
                self._not_published(message.input, outlet, str(error))
            else:
                if self.unpublished:
                    self._published(message.input, outlet)
        return newest

    def _note(self, match: Match, stamps: tuple[int | None, ...], latency: int) -> Note:
        """Note what the manifest of the set that was just sent tells. Its payloads are not kept: they may be large."""
        common, left_as = match.stamp, stamps
        if common is not None:
            pairs = zip(stamps, self._restamped, strict=True)
            left_as = tuple([common if restamped and stamp is not None else stamp for stamp, restamped in pairs])
        received = [None if message is None else message.payload[1] for message in match.messages]
        sent = [0 if outlet is None else outlet.sent for outlet in self._outlets]
        unpublished = _NONE_UNPUBLISHED
        if self.unpublished:
            unpublished = {index: each.why for index, each in self.unpublished.items()}
            sent = [0 if index in unpublished else count for index, count in enumerate(sent)]
        return Note(self._left, latency, common, stamps, left_as, received, sent, unpublished)

    def _not_published(self, index: int, outlet: Outlet, why: str) -> None:
        before = self.unpublished.get(index)
        self.unpublished[index] = Unpublished(1 + (before.messages if before else 0), why)
        if before is None:
            _LOG.error(
                "%s: a message could not be published on %s: %s; trying again with the next one",
                self.config.name,
                outlet.topic,
                why,
                extra={"group": self.config.name, "finding": Code.REFUSED_BY_DDS.value},
            )

    def _published(self, index: int, outlet: Outlet) -> None:
        recovered = self.unpublished.pop(index, None)
        if recovered is not None:
            _LOG.info(
                "%s: publishing on %s again; %s not published",
                self.config.name,
                outlet.topic,
                f"{counted(recovered.messages, 'message')} {'was' if recovered.messages == 1 else 'were'}",
                extra={"group": self.config.name},
            )
