"""A group's engine driven through messages in the order of their receipt, each at its time, as the relay drives it."""

from collections.abc import Callable, Iterable, Sequence
from copy import copy, deepcopy
from itertools import tee
from typing import Any, Final, Protocol, TypeAlias

from syncrelay.clock import UNREADABLE
from syncrelay.config import GroupConfig
from syncrelay.frames import Edge, Frames
from syncrelay.sync import DropReason, Message, Outcome

Take: TypeAlias = Callable[[Sequence[Outcome], int], None]
"""Told of what leaves together, and at what time, in nanoseconds of receipt."""


class _Add(Protocol):
    def __call__(self, message: Message, *, now: int) -> object:
        """Add a message after all that is due before it."""
        ...


class EngineDriver:
    """Drives an engine of its own through one group's messages; times of receipt are the only clock."""

    def __init__(
        self, group: GroupConfig, take: Take | None, transforms: Iterable[tuple[int, Edge]] | None = None
    ) -> None:
        """Take None where nobody is to be told.

        `transforms` are those that come, each with its time of receipt; more come by `learn`. With None, no set waits
        for any.
        """
        self._frames = Frames()
        self.engine: Final = group.engine(None if transforms is None else self._frames)
        coming = () if transforms is None or group.options.transforms is None else transforms
        # Unlike other iterators, these can be copied.
        (self._transforms,) = tee(coming, 1)
        self._coming = next(self._transforms, None)
        # Else nothing is ever due, and asking for each message costs a tenth of a replay.
        self.has_deadlines: Final = group.has_deadlines
        # Ticks go on for a while after the last message: those of the time after it are nobody's.
        self._last_wait = (group.options.max_wait or 0) if group.ticks is not None else None
        self._due = self.engine.next_deadline()
        self._take = take or _take_nothing
        # Every message would pay for a call between.
        self.add: Final[_Add] = self._add if take is not None or self.has_deadlines else self.engine.add

    def _add(self, message: Message, *, now: int) -> None:
        if self._due is not None or self._coming is not None:
            self.expire(now)
        outcomes = self.engine.add(message, now=now)
        if self.has_deadlines:
            self._due = self.engine.next_deadline()
        if outcomes:
            self._take(outcomes, now)

    def reject(self, index: int, payload: Any, *, now: int) -> None:
        """Count a message of which no stamp or key could be read."""
        self.expire(now)
        self._take([self.engine.reject(Message(index, 0, payload), DropReason.MALFORMED)], now)

    def ahead(self, take: Take) -> "EngineDriver":
        """Return another driver, which goes on from here by itself and tells someone else."""
        return deepcopy(self, {id(self._take): take, id(self._transforms): copy(self._transforms)})

    def run(self, messages: Iterable[Message]) -> None:
        """Feed messages, then let all leave that may."""
        self.finish(self.feed(messages))

    def feed(self, messages: Iterable[Message]) -> int:
        """Add messages whose payload is the time when they were received; count those that are UNREADABLE as malformed.

        Return when the last of them was received, 0 where there is none.
        """
        add, take, now = self.engine.add, self._take, 0
        for message in messages:
            now = message.payload
            if message.stamp == UNREADABLE:
                self.reject(message.input, now, now=now)
            elif self.has_deadlines:
                self.add(message, now=now)
            # Every message would pay for a call between.
            elif outcomes := add(message, now=now):
                take(outcomes, now)
        return now

    def expire(self, now: int) -> None:
        """Let what has waited long enough leave, each at its own time, up to `now`; learn what came till then."""
        while self._coming is not None and self._coming[0] <= now:
            received, edge = self._coming
            self._coming = next(self._transforms, None)
            self.learn([edge], now=received)
        self._expire_due(now)

    def _expire_due(self, now: int) -> None:
        while self._due is not None and self._due <= now:
            due = self._due
            outcomes = self.engine.expire(now=due)
            self._due = self.engine.next_deadline()
            self._take(outcomes, due)

    def learn(self, edges: Sequence[Edge], *, now: int) -> None:
        """Take transforms that are received; sets leave that waited for them."""
        self._expire_due(now)
        for edge in edges:
            self._frames.add(edge)
        self._take(self.engine.expire(now=now), now)
        self._due = self.engine.next_deadline()

    def finish(self, now: int) -> None:
        """Let all leave that may: what still waits has a deadline, or will never have a partner.

        Of the ticks of a clock, those up to `now` do.
        """
        while self._coming is not None:
            now = max(now, self._coming[0])
            self.expire(now)
        last = None if self._last_wait is None else now + self._last_wait
        while (deadline := self.engine.next_deadline()) is not None and (last is None or deadline <= last):
            self._take(self.engine.expire(now=deadline), deadline)
            now = max(now, deadline)
        self._take(self.engine.flush(DropReason.SHUTDOWN), now)


def _take_nothing(_outcomes: Sequence[Outcome], _now: int) -> None:
    """Stand in for who is told."""
