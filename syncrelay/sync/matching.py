"""A policy at work in a group, whose sets leave when it makes them, or with a limit to what may wait.

Both kinds have the methods of a policy, with inputs in place of its places. `feed` takes an input, the stamp to match
by and a message, at the time of the last `due`, which returns what has waited long enough; `next_deadline` is when
something will have, if no message comes before.
"""

from collections import deque
from collections.abc import Sequence

from syncrelay.sync.arrivals import Arrivals
from syncrelay.sync.lending import Search, SearchTerms
from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.policy import Policy
from syncrelay.sync.waiting import Waiting


class Prompt:
    """Sets leave when the policy makes them: those of a clock's tick `max_wait_ns` after it."""

    __slots__ = ("_max_wait", "_policy", "feed")

    def __init__(self, policy: Policy, *, required: Sequence[bool], quorum: int, max_wait_ns: int) -> None:
        self._policy, stage = policy.for_required(required, quorum)
        if stage.inputs:
            raise ValueError("an optional input needs max_wait_ns: a set would wait for it without end")
        self._max_wait = max_wait_ns
        # The policy's own method: a method between would be called for every message.
        self.feed = self._policy.feed

    @property
    def is_new(self) -> bool:
        return self._policy.is_new

    @property
    def search_terms(self) -> SearchTerms | None:
        return self._policy.search_terms

    def lend(self, newest: Sequence[int]) -> Search | None:
        return self._policy.lend(newest)

    def take_back(self, search: Search) -> None:
        self._policy.take_back(search)

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


class Limited:
    """A set waits no longer than `max_wait_ns` from when its required messages, and enough others, are there.

    A wait counts from the `now` at which the message that began it was fed. Where `now` falls, all waits count from
    the new `now`, so that no set waits longer.
    """

    __slots__ = (
        "_arrivals",
        "_has_changed",
        "_max_wait",
        "_now",
        "_offsets",
        "_oldest_since",
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
        quorum: int,
        max_wait_ns: int,
        offsets_ns: Sequence[int],
    ) -> None:
        self._policy, self._stage = policy.for_required(required, quorum)
        taken = [index for index in range(policy.n_inputs) if index not in self._stage.inputs]
        self._places = {index: place for place, index in enumerate(taken)}
        self._arrivals = arrivals
        self._offsets = offsets_ns
        self._max_wait = max_wait_ns
        self._now = 0
        self._since: deque[int] = deque()
        # The stage's, as long as it has not changed: it takes long to find, and is asked for at every turn.
        self._oldest_since: int | None = None
        self._has_changed = True
        self._waits_started = self._waits_ended = 0

    def feed(self, index: int, stamp: int, message: Message) -> Sequence[Outcome]:
        place = self._places.get(index)
        if place is None:
            self._has_changed = True
            outcomes = self._stage.put(index, stamp, message, self._now)
        else:
            outcomes = self._join(self._policy.feed(place, stamp, message), self._now)
        return [*outcomes, *self.due(self._now)]

    def due(self, now: int) -> Sequence[Outcome]:
        if now < self._now:
            self._since = deque(min(since, now) for since in self._since)
            self._stage.wait_from(now)
            self._has_changed = True
        self._now = now
        outcomes: list[Outcome] = []
        while (deadline := self.next_deadline()) is not None and deadline <= now:
            if self._oldest_since is not None:
                outcomes += self._stage.leave()
                self._has_changed = True
            else:
                outcomes += self._join(self._policy.release_oldest(), now)
        return outcomes

    def next_deadline(self) -> int | None:
        # The sets in the stage left the policy before anything that still waits in it, and began to wait no later.
        if self._has_changed:
            self._oldest_since, self._has_changed = self._stage.oldest_since, False
        since = self._oldest_since
        if since is None and self._since:
            since = self._since[0]
        return None if since is None else since + self._max_wait

    def pass_over(self, now: int) -> None:
        """Let time pass: only a clock would give sets meanwhile."""

    def flush(self, reason: DropReason) -> list[Drop]:
        drops = self._policy.flush(reason) + self._stage.flush(reason)
        self._has_changed = True
        self._note_waits(self._now)
        return drops

    def let_go(self, reason: DropReason) -> list[Drop]:
        drops = self._policy.let_go(reason) + self._stage.let_go(reason)
        self._has_changed = True
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
            joined += self._stage.hold(self._widened(outcome, since))
            self._has_changed = True
            since = now
        return joined

    def _widened(self, match: Match, since: int) -> Waiting:
        """Return a set with a place for every input, and the stamps that it was matched by."""
        messages: list[Message | None] = [None] * len(self._offsets)
        stamps = {}
        for message in match.messages:
            if message is not None:
                messages[message.input] = message
                stamps[message.input] = message.stamp + self._offsets[message.input]
        return Waiting(tuple(messages), stamps, min(stamps.values()), max(stamps.values()), since)

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
