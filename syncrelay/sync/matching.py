"""A policy at work in a group: at once, with a limit to what may wait, or by the clock."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

from syncrelay.sync.arrivals import Arrivals
from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.policy import Policy


class Matching(Protocol):
    """Feeds a policy the messages of a group, and lets sets leave in time. By default sets leave when they are made."""

    __slots__ = ()

    _policy: Policy

    feed: Callable[[int, int, Message], Sequence[Outcome]]
    """Takes an input, the stamp to match by and a message, at the time of the last `due`; returns what leaves."""

    def due(self, now: int) -> Sequence[Outcome]:
        """Return what has waited long enough."""
        del now
        return ()

    def next_deadline(self) -> int | None:
        """Return when something will have waited long enough, if no message comes before."""
        return None

    def pass_over(self, now: int) -> None:
        """Let time pass without the sets that only the clock would have given."""
        del now

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop all that is buffered, and be as new."""
        return self._policy.flush(reason)

    def let_go(self, reason: DropReason) -> list[Drop]:
        """Drop what waits for others; see Policy."""
        return self._policy.let_go(reason)

    def buffered(self, index: int) -> int:
        """Return how many messages of this input are buffered and have been in no set."""
        return self._policy.buffered(index)

    def needed_queue(self, index: int) -> int | None:
        """See Policy."""
        return self._policy.needed_queue(index)


class Unlimited(Matching):
    """A set waits as long as the policy has it wait, so it must not wait for an optional input."""

    __slots__ = ("_policy", "feed")

    def __init__(self, policy: Policy, *, required: Sequence[bool]) -> None:
        self._policy, stage = policy.for_required(required)
        if stage.inputs:
            raise ValueError("an optional input needs max_wait_ns: a set would wait for it without end")
        # The policy's own method: a method between would be called for every message.
        self.feed = self._policy.feed


class ByClock(Matching):
    """A policy that makes its sets as time passes: the set of a time leaves `max_wait_ns` after it."""

    __slots__ = ("_max_wait", "_policy", "feed")

    def __init__(self, policy: Policy, *, required: Sequence[bool], max_wait_ns: int) -> None:
        self._policy, stage = policy.for_required(required)
        if stage.inputs:
            raise ValueError("a policy that is by the clock deals with optional inputs itself")
        self._max_wait = max_wait_ns
        self.feed = self._policy.feed

    def due(self, now: int) -> Sequence[Outcome]:
        return self._policy.advance(now - self._max_wait)

    def next_deadline(self) -> int | None:
        tick = self._policy.next_tick()
        return None if tick is None else tick + self._max_wait

    def pass_over(self, now: int) -> None:
        self._policy.pass_over(now - self._max_wait)


class Limited(Matching):
    """A set waits no longer than `max_wait_ns` from when its required messages are all there.

    A wait counts from the `now` at which the message that began it was fed. Where `now` falls, all waits count from
    the new `now`, so that no set waits longer.
    """

    __slots__ = (
        "_arrivals",
        "_max_wait",
        "_now",
        "_offsets",
        "_places",
        "_policy",
        "_since",
        "_stage",
        "_waits_ended",
        "_waits_started",
        "feed",
    )

    def __init__(
        self,
        policy: Policy,
        arrivals: Arrivals,
        *,
        required: Sequence[bool],
        max_wait_ns: int,
        offsets_ns: Sequence[int],
    ) -> None:
        self._policy, self._stage = policy.for_required(required)
        taken = [index for index in range(policy.n_inputs) if index not in self._stage.inputs]
        self._places = {index: place for place, index in enumerate(taken)}
        self._arrivals = arrivals
        self._offsets = offsets_ns
        self._max_wait = max_wait_ns
        self._now = 0
        self._since: deque[int] = deque()
        self._waits_started = self._waits_ended = 0
        self.feed = self._fed

    def _fed(self, index: int, stamp: int, message: Message) -> Sequence[Outcome]:
        place = self._places.get(index)
        if place is None:
            outcomes = self._stage.put(index, stamp, message)
        else:
            outcomes = self._join(self._policy.feed(place, stamp, message), self._now)
        return [*outcomes, *self.due(self._now)]

    def due(self, now: int) -> Sequence[Outcome]:
        if now < self._now:
            self._since = deque(min(since, now) for since in self._since)
            self._stage.wait_from(now)
        self._now = now
        outcomes: list[Outcome] = []
        while (deadline := self.next_deadline()) is not None and deadline <= now:
            if self._stage.oldest_since is not None:
                outcomes += self._stage.leave()
            else:
                outcomes += self._join(self._policy.release_oldest(), now)
        return outcomes

    def next_deadline(self) -> int | None:
        # The sets in the stage left the policy before anything that still waits in it, and began to wait no later.
        since = self._stage.oldest_since
        if since is None and self._since:
            since = self._since[0]
        return None if since is None else since + self._max_wait

    def flush(self, reason: DropReason) -> list[Drop]:
        drops = self._policy.flush(reason) + self._stage.flush(reason)
        self._note_waits(self._now)
        return drops

    def let_go(self, reason: DropReason) -> list[Drop]:
        drops = self._policy.let_go(reason) + self._stage.flush(reason)
        self._note_waits(self._now)
        return drops

    def buffered(self, index: int) -> int:
        place = self._places.get(index)
        return self._stage.buffered(index) + (0 if place is None else self._policy.buffered(place))

    def needed_queue(self, index: int) -> int | None:
        place = self._places.get(index)
        return None if place is None else self._policy.needed_queue(place)

    def _join(self, outcomes: Sequence[Outcome], now: int) -> list[Outcome]:
        """Hand the sets of the policy to the stage, where messages of the optional inputs join them."""
        since = self._note_waits(now)
        joined: list[Outcome] = []
        for outcome in outcomes:
            if isinstance(outcome, Drop):
                joined.append(outcome)
                continue
            # Sets may wait in the stage. A message that is older than theirs is late already.
            self._arrivals.give(outcome.messages)
            joined += self._stage.hold(*self._widened(outcome), since)
            since = now
        return joined

    def _widened(self, match: Match) -> tuple[tuple[Message | None, ...], int, int]:
        """Return a set with a place for every input, and the least and the greatest stamp that it was matched by."""
        messages: list[Message | None] = [None] * len(self._offsets)
        stamps = []
        for message in match.messages:
            if message is not None:
                messages[message.input] = message
                stamps.append(message.stamp + self._offsets[message.input])
        return tuple(messages), min(stamps), max(stamps)

    def _note_waits(self, now: int) -> int:
        """Note which waits began and ended. Return when the first one that ended had begun, `now` if none ended."""
        policy = self._policy
        self._since.extend([now] * (policy.waits_started - self._waits_started))
        ended = policy.waits_ended - self._waits_ended
        self._waits_started, self._waits_ended = policy.waits_started, policy.waits_ended
        since = self._since[0] if ended else now
        for _ in range(ended):
            self._since.popleft()
        return since
