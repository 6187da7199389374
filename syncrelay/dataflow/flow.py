"""The way of a message through its group: its stamp is read, the engine matches it, its set leaves on the outlets."""

import logging
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol, Self, TypeAlias

from syncrelay.cdr import read_stamp
from syncrelay.config import GroupConfig
from syncrelay.config.wording import counted
from syncrelay.dataflow.backend import Deliver, Outlet, Payload, PublishError
from syncrelay.dataflow.engines import PausedEngine, StoppedEngine
from syncrelay.explain import Code, RecentDrop, Stamps, Tape
from syncrelay.runtime import SYSTEM, Runtime
from syncrelay.sync import Drop, DropReason, Match, Message, SyncGroup

if TYPE_CHECKING:
    from syncrelay.dataflow.bundle import BundleOutlet

_LOG = logging.getLogger("syncrelay")

Engine: TypeAlias = SyncGroup | PausedEngine | StoppedEngine

# Enough for the strip of recent sets on the widest terminal.
RECENT: Final = 256
# What is kept between two evaluations: at 1 kHz they may be 10 s apart.
_WATCHED: Final = 10_000


class Watched(NamedTuple):
    """Stamps and times of receipt of each input's messages, and stamps and latency of each set; in nanoseconds."""

    arrivals: tuple[deque[tuple[int, int]], ...]
    sets: deque[tuple[Stamps, int]]

    @classmethod
    def none_of(cls, n_inputs: int) -> Self:
        """Return what is filled next."""
        return cls(tuple([deque(maxlen=_WATCHED) for _ in range(n_inputs)]), deque(maxlen=_WATCHED))


class Unpublished(NamedTuple):
    """How many messages of an input could not be published one after the other, and why the last one could not.

    `is_unfit` says that it, or its type, does not fit the bundle; else DDS refused.
    """

    messages: int
    why: str
    is_unfit: bool = False


class Refusals:
    """Counts what the outlets of a group refuse, and says it once."""

    def __init__(self, group: str) -> None:
        self.unpublished: dict[int, Unpublished] = {}
        """The inputs of which the last message could not be published."""
        self._group = group

    def refused(self, index: int, outlet: Outlet, why: str, *, is_unfit: bool = False) -> None:
        """Note that an outlet did not publish a message of this input."""
        before = self.unpublished.get(index)
        self.unpublished[index] = Unpublished(1 + (before.messages if before else 0), why, is_unfit)
        if before is None:
            _LOG.error(
                "%s: a message could not be published on %s: %s; trying again with the next one",
                self._group,
                outlet.topic,
                why,
                extra={"group": self._group, "finding": Code.REFUSED_BY_DDS.value},
            )

    def accepted(self, index: int, outlet: Outlet) -> None:
        """Note that an outlet published a message of this input."""
        recovered = self.unpublished.pop(index, None)
        if recovered is not None:
            _LOG.info(
                "%s: publishing on %s again; %s not published",
                self._group,
                outlet.topic,
                f"{counted(recovered.messages, 'message')} {'was' if recovered.messages == 1 else 'were'}",
                extra={"group": self._group},
            )


class Manifests(Protocol):
    """What hears of each set that left, and of its latency in nanoseconds."""

    is_heard: bool
    """Whether anyone is told of it."""

    def tell(self, flow: "Flow", match: Match, latency: int) -> None:
        """Tell of a set that a flow just sent."""
        ...


class Flow:
    """Feeds an engine on the receive thread and publishes the sets that it gives. What it raises stops its group.

    It holds no reference to its group: in a cycle, a group that ended would keep its messages until Python collects
    garbage.
    """

    def __init__(
        self,
        config: GroupConfig,
        *,
        now: Callable[[], int],
        refusals: Refusals,
        tape: Tape,
        runtime: Runtime = SYSTEM,
    ) -> None:
        n_inputs = len(config.topics)
        self.engine: Engine = config.engine()
        self.outlets: list[Outlet | None] = [None] * n_inputs
        self.restamped = [False] * n_inputs
        """Which inputs' payloads begin with a Header, whose stamp the set's common stamp replaces."""
        self.keys: list[Hashable] = [None] * n_inputs
        """What the newest messages are matched by."""
        self.last: deque[Stamps | RecentDrop] = deque(maxlen=RECENT)
        """What left last, oldest first: the stamps of a set, or a message that was dropped."""
        self.n_sets = 0
        """How many sets left: what manifests number them by."""
        self.unpublished = refusals.unpublished
        """The inputs of which the last message could not be published."""
        self.bundle: BundleOutlet | None = None
        """What publishes the sets as one message each."""
        self.manifests: Manifests | None = None
        self._config = config
        self._now = now
        self._time_ns = runtime.time_ns
        self._refusals = refusals
        self._tape = tape
        self._watched = Watched.none_of(n_inputs)

    def watched(self) -> Watched:
        """Give what came and left since this was last asked for."""
        watched, self._watched = self._watched, Watched.none_of(len(self.outlets))
        return watched

    def by_header(self, index: int, fail: Callable[[Exception], None]) -> Deliver:
        """What takes an input's payloads that begin with a Header. It raises nothing: an exception goes to `fail`."""

        # A `try` costs nothing where nothing is raised; one more call for each message would.
        def deliver(payload: Payload) -> None:
            try:
                self.receive(index, payload, read_stamp(payload.content()))
            except Exception as error:  # noqa: BLE001  nobody else on the topic is to suffer
                fail(error)

        return deliver

    def receive(
        self, index: int, payload: Payload, stamp: int | None, key: Hashable = None, frame: str | None = None
    ) -> None:
        """Take in a message of one input, whose stamp, in nanoseconds, is None where it or the key cannot be read."""
        if stamp is None:
            self.conclude([self.engine.reject(Message(index, 0, payload), DropReason.MALFORMED)])
            return
        self._watched.arrivals[index].append((stamp, payload.received))
        if key is not None:
            self.keys[index] = key
        outcomes = self.engine.add(Message(index, stamp, payload, key, frame), now=self._now())
        if outcomes:
            self.conclude(outcomes)

    def conclude(self, outcomes: Sequence[Match | Drop]) -> None:
        """Publish the sets among these, and note what left."""
        is_tapped = self._tape.is_on
        for outcome in outcomes:
            if isinstance(outcome, Match):
                newest = self._send(outcome)
                stamps, left = outcome.stamps, self._time_ns()
                latency = left - newest
                self._watched.sets.append((stamps, latency))
                self.last.append(stamps)
                self.n_sets += 1
                if self.manifests is not None:
                    self.manifests.tell(self, outcome, latency)
                if is_tapped:
                    self._tape.note(self._config, stamps, left, newest)
            else:
                message = outcome.message
                drop = RecentDrop(message.input, message.stamp, outcome.reason)
                self.last.append(drop)
                if is_tapped:
                    self._tape.note(self._config, drop, self._time_ns(), message.payload.received)

    def _send(self, match: Match) -> int:
        """Publish a set, and return when its newest message was received."""
        if self.bundle is not None:
            self.bundle.send(match, self.n_sets + 1)
        newest = 0
        for message in match.messages:
            if message is None:
                continue
            index, payload = message.input, message.payload
            newest = max(newest, payload.received)
            outlet = self.outlets[index]
            if outlet is None:
                continue
            try:
                if match.stamp is not None and self.restamped[index]:
                    outlet.send_stamped(payload, match.stamp)
                else:
                    outlet.send(payload)
            except PublishError as error:
                self._refusals.refused(index, outlet, str(error))
            else:
                if self.unpublished:
                    self._refusals.accepted(index, outlet)
        return newest
