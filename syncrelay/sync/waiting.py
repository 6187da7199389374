"""What all stages share where sets wait for inputs that may be missing: which set may leave, and since when."""

from collections import deque
from collections.abc import Hashable, Iterator, Mapping, Sequence
from itertools import chain, islice
from typing import NamedTuple, Protocol, TypeAlias

from syncrelay.sync.messages import Drop, DropReason, Message, Outcome


class Waiting(NamedTuple):
    """What a set is made round: its messages, their stamps, the least and the greatest of these, when its wait began.

    The messages are those of the required inputs, None for the others. Where no input is required there are none yet,
    and the one stamp is that of the message which the set is made round.
    """

    messages: tuple[Message | None, ...]
    stamps: Mapping[int, int]
    low: int
    high: int
    since: int


Seed: TypeAlias = tuple[Waiting, Waiting | None]
"""What a set is made round, and what the next one is: a message goes to the nearer of the two."""


class OptionalStage(Protocol):
    """Adds messages of the optional `inputs` to the sets of the required ones, which leave in the order they come.

    A set may leave once it is not `lacking` any. It does when it is decided what it takes, when `queue_size` sets wait
    behind it, or when `leave` is called. Older ones, which lack inputs, are superseded then.
    """

    inputs: Sequence[int]
    lacking: int
    """How many messages of these a set needs."""

    queue_size: int
    waiting: deque[Waiting]

    came: dict[int, dict[Hashable, int]]
    """When each message of the optional inputs came, by its stamp or key."""

    @property
    def oldest_since(self) -> int | None:
        """Since when a set has been able to leave, behind others or not; None if none is."""
        if self.lacking <= 0:
            return self.waiting[0].since if self.waiting else None
        return min((since for seed in self.seeds() if (since := self._since(seed)) is not None), default=None)

    def wait_from(self, now: int) -> None:
        """Let no wait have begun later than `now`, because the clock fell."""
        self.waiting = deque(waiting._replace(since=min(waiting.since, now)) for waiting in self.waiting)
        for came in self.came.values():
            came.update({name: now for name, time in came.items() if time > now})

    def hold(self, waiting: Waiting) -> list[Outcome]:
        """Take a set of the required inputs; return what leaves."""
        self.waiting.append(waiting)
        outcomes = self.leave_decided()
        if len(self.waiting) > self.queue_size:
            outcomes += self.leave()
        return outcomes

    def leave_decided(self) -> list[Outcome]:
        """Let the oldest set leave, or give it up if it lacks inputs, while nothing that may still come changes it."""
        outcomes: list[Outcome] = []
        while (seed := self.oldest()) is not None and (not self.inputs or self.is_decided(seed)):
            outcomes += self.give_up(DropReason.TOO_FAR) if self._since(seed) is None else self.complete(seed)
        return outcomes

    def leave(self) -> list[Outcome]:
        """Let the oldest set that may leave do so with what there is. Where none may, the oldest overflows."""
        first = self._first_to_leave()
        if first is None:
            return self.give_up(DropReason.OVERFLOW)
        outcomes: list[Outcome] = []
        while self.waiting and self.waiting[0] is not first[0]:
            outcomes += self.give_up(DropReason.SUPERSEDED)
        return outcomes + self.complete(first)

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop everything, and be as new."""
        return self.let_go(reason)

    def let_go(self, reason: DropReason) -> list[Drop]:
        """Drop everything. Later sets are not older than those before."""
        held = [message for waiting in self.waiting for message in waiting.messages if message is not None]
        self.waiting.clear()
        for came in self.came.values():
            came.clear()
        return [Drop(message, reason) for message in held + self.empty()]

    def buffered(self, index: int) -> int:
        """How many messages of this input, required or not, are in here."""
        return sum(waiting.messages[index] is not None for waiting in self.waiting) + len(self.came.get(index, ()))

    def give_up(self, reason: DropReason) -> list[Outcome]:
        """Drop the required messages of the oldest set."""
        return [Drop(message, reason) for message in self.waiting.popleft().messages if message is not None]

    def _first_to_leave(self) -> Seed | None:
        return next((seed for seed in self.seeds() if self._since(seed) is not None), None)

    def _since(self, seed: Seed) -> int | None:
        """Return since when a set has had enough inputs; None if it has not."""
        waiting, _ = seed
        if self.lacking <= 0:
            return waiting.since
        came = sorted(self.came[index][name] for index, name in self.chosen(seed).items())
        return max(waiting.since, came[self.lacking - 1]) if len(came) >= self.lacking else None

    def oldest(self) -> Seed | None:
        """Return what the oldest set may be made round."""
        waiting = self.waiting
        if not waiting:
            return None
        return waiting[0], waiting[1] if len(waiting) > 1 else None

    def seeds(self) -> Iterator[Seed]:
        """Yield what sets may be made round, the oldest first."""
        return zip(self.waiting, chain(islice(self.waiting, 1, None), (None,)), strict=False)

    def put(self, index: int, stamp: int, message: Message, now: int) -> list[Outcome]:
        """Take a message of an optional input, which comes at `now`; return what leaves because of it."""
        ...

    def chosen(self, seed: Seed) -> Mapping[int, Hashable]:
        """Return the stamp, or key, of the message that each optional input has for a set."""
        ...

    def complete(self, seed: Seed) -> list[Outcome]:
        """Let a set leave, with what is chosen for it."""
        ...

    def is_decided(self, seed: Seed) -> bool:
        """Whether no later message can change what the set takes."""
        ...

    def empty(self) -> list[Message]:
        """Return all messages of optional inputs, and forget what these have sent."""
        ...
