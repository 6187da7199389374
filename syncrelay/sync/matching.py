"""A policy at work in a group: at once, with a limit to what may wait, or by the clock."""

from collections import deque
from collections.abc import Sequence
from typing import Protocol

from syncrelay.sync.arrivals import Arrivals
from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.policy import Policy


class Matching(Protocol):
    """Feeds a policy."""

    __slots__ = ()

    def feed(self, index: int, stamp: int, message: Message) -> Sequence[Outcome]:
        """Take a message of an input to be matched at `stamp`, at the time of the last `due`; give what leaves."""
        ...

    def due(self, now: int) -> Sequence[Outcome]:
        """Give what has waited long enough."""
        ...

    def next_deadline(self) -> int | None:
        """When something will have waited long enough, if nothing else comes."""
        ...

    def pass_over(self, now: int) -> None:
        """Let time pass without the sets that only the clock would have given."""
        ...

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop all that is buffered, and be as new."""
        ...

    def let_go(self, reason: DropReason) -> list[Drop]:
        """Drop what waits for others; see Policy."""
        ...

    def buffered(self, index: int) -> int:
        """How many messages of this input are buffered and have been in no set."""
        ...

    def needed_queue(self, index: int) -> int | None:
        """See Policy."""
        ...


class Unlimited:
    """A set waits as long as the policy has it wait: no input may be optional that it would wait for."""

    __slots__ = ("_policy", "feed")

    def __init__(self, policy: Policy, *, required: Sequence[bool]) -> None:
        self._policy, stage = policy.for_required(required)
        if stage.inputs:
            raise ValueError("an optional input needs max_wait_ns: a set would wait for it without end")
        # The policy's own: every message would pay for a call between.
        self.feed = self._policy.feed

    def due(self, now: int) -> Sequence[Outcome]:
        del now
        return ()

    def next_deadline(self) -> int | None:
        return None

    def pass_over(self, now: int) -> None:
        del now

    def flush(self, reason: DropReason) -> list[Drop]:
        return self._policy.flush(reason)

    def let_go(self, reason: DropReason) -> list[Drop]:
        return self._policy.let_go(reason)

    def buffered(self, index: int) -> int:
        return self._policy.buffered(index)

    def needed_queue(self, index: int) -> int | None:
        return self._policy.needed_queue(index)


class ByClock(Matching):
    """A policy that makes its sets as time passes: those of a time leave `max_wait_ns` after it."""

    __slots__ = ("_max_wait", "_policy")

    def __init__(self, policy: Policy, *, required: Sequence[bool], max_wait_ns: int) -> None:
        self._policy, stage = policy.for_required(required)
        if stage.inputs:
            raise ValueError("a policy that is by the clock deals with optional inputs itself")
        self._max_wait = max_wait_ns

    def feed(self, index: int, stamp: int, message: Message) -> Sequence[Outcome]:
        return self._policy.feed(index, stamp, message)

    def due(self, now: int) -> Sequence[Outcome]:
        return self._policy.advance(now - self._max_wait)

    def next_deadline(self) -> int | None:
        tick = self._policy.next_tick()
        return None if tick is None else tick + self._max_wait

    def pass_over(self, now: int) -> None:
        self._policy.pass_over(now - self._max_wait)

    def flush(self, reason: DropReason) -> list[Drop]:
        return self._policy.flush(reason)

    def let_go(self, reason: DropReason) -> list[Drop]:
        return self._policy.let_go(reason)

    def buffered(self, index: int) -> int:
        return self._policy.buffered(index)

    def needed_queue(self, index: int) -> int | None:
        return self._policy.needed_queue(index)


class Limited(Matching):
    """A set waits no longer than `max_wait_ns` from when its required messages are all there.

    Waits count from the `now` at which the message that began them was fed. Where `now` falls, they count from
    there: no set waits longer because of it.
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

    def feed(self, index: int, stamp: int, message: Message) -> Sequence[Outcome]:
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
        # What is in the stage left the policy before anything that still waits there, and began no later.
        since = self._stage.oldest_since
        if since is None and self._since:
            since = self._since[0]
        return None if since is None else since + self._max_wait

    def pass_over(self, now: int) -> None:
        del now

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
        """Let the optional inputs join the sets of the policy."""
        since = self._note_waits(now)
        joined: list[Outcome] = []
        for outcome in outcomes:
            if isinstance(outcome, Drop):
                joined.append(outcome)
                continue
            # They may wait here: what would take their inputs back is late already.
            self._arrivals.give(outcome.messages)
            joined += self._stage.hold(*self._widened(outcome), since)
            since = now
        return joined

    def _widened(self, match: Match) -> tuple[tuple[Message | None, ...], int, int]:
        """Give a set a place for every input, with the least and the greatest stamp it is matched by."""
        messages: list[Message | None] = [None] * len(self._offsets)
        stamps = []
        for message in match.messages:
            if message is not None:
                messages[message.input] = message
                stamps.append(message.stamp + self._offsets[message.input])
        return tuple(messages), min(stamps), max(stamps)

    def _note_waits(self, now: int) -> int:
        """See what waits began and ended; give when the first that ended had begun, `now` if none did."""
        policy = self._policy
        self._since.extend([now] * (policy.waits_started - self._waits_started))
        ended = policy.waits_ended - self._waits_ended
        self._waits_started, self._waits_ended = policy.waits_started, policy.waits_ended
        since = self._since[0] if ended else now
        for _ in range(ended):
            self._since.popleft()
        return since
