"""The stage where sets of required inputs wait for messages of the optional ones, by keys."""

from collections import deque
from collections.abc import Hashable, Sequence
from typing import NamedTuple

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.policy import OptionalStage


class _Waiting(NamedTuple):
    messages: tuple[Message | None, ...]
    key: Hashable
    since: int


class OptionalKeys(OptionalStage):
    """Adds to each set, for each optional input, the message of its key.

    Sets leave in the order they come. A set leaves when each optional input has sent its key or that of a later set
    that waits, or when `leave` is called. When a message leaves in a set, those of its input that came before it or
    have an older stamp are superseded.
    """

    __slots__ = ("_queue_size", "_queues", "_waiting", "inputs")

    def __init__(self, *, required: Sequence[bool], queue_size: int) -> None:
        self.inputs: Sequence[int] = [index for index, needed in enumerate(required) if not needed]
        self._queue_size = queue_size
        self._queues: dict[int, dict[Hashable, Message]] = {index: {} for index in self.inputs}
        self._waiting: deque[_Waiting] = deque()

    @property
    def oldest_since(self) -> int | None:
        return self._waiting[0].since if self._waiting else None

    def wait_from(self, now: int) -> None:
        self._waiting = deque(waiting._replace(since=min(waiting.since, now)) for waiting in self._waiting)

    def put(self, index: int, stamp: int, message: Message) -> list[Outcome]:
        del stamp
        queue = self._queues[index]
        replaced = queue.pop(message.key, None)
        outcomes: list[Outcome] = [] if replaced is None else [Drop(replaced, DropReason.DUPLICATE)]
        queue[message.key] = message
        outcomes += self._leave_decided()
        if len(queue) > self._queue_size:
            outcomes.append(Drop(queue.pop(next(iter(queue))), DropReason.OVERFLOW))
        return outcomes

    def hold(self, messages: tuple[Message | None, ...], low: int, high: int, since: int) -> list[Outcome]:
        del low, high
        key = next(message.key for message in messages if message is not None)
        self._waiting.append(_Waiting(messages, key, since))
        outcomes = self._leave_decided()
        if len(self._waiting) > self._queue_size:
            outcomes += self.leave()
        return outcomes

    def leave(self) -> list[Outcome]:
        waiting = self._waiting.popleft()
        messages = list(waiting.messages)
        drops: list[Drop] = []
        for index, queue in self._queues.items():
            member = messages[index] = queue.get(waiting.key)
            if member is not None:
                drops += [Drop(message, DropReason.SUPERSEDED) for message in _take_with_older(queue, member)]
        return [*drops, Match(tuple(messages))]

    def flush(self, reason: DropReason) -> list[Drop]:
        held = [message for waiting in self._waiting for message in waiting.messages if message is not None]
        queued = [message for queue in self._queues.values() for message in queue.values()]
        self._waiting.clear()
        for queue in self._queues.values():
            queue.clear()
        return [Drop(message, reason) for message in held + queued]

    def buffered(self, index: int) -> int:
        held = sum(waiting.messages[index] is not None for waiting in self._waiting)
        return held + len(self._queues.get(index, ()))

    def _leave_decided(self) -> list[Outcome]:
        outcomes: list[Outcome] = []
        while self._waiting and all(self._has_shown(queue) for queue in self._queues.values()):
            outcomes += self.leave()
        return outcomes

    def _has_shown(self, queue: dict[Hashable, Message]) -> bool:
        return any(waiting.key in queue for waiting in self._waiting)


def _take_with_older(queue: dict[Hashable, Message], member: Message) -> list[Message]:
    """Remove a message and all that came before it or have an older stamp; return those."""
    keys = list(queue)
    position = keys.index(member.key)
    older = keys[:position] + [key for key in keys[position:] if queue[key].stamp < member.stamp]
    del queue[member.key]
    return [queue.pop(key) for key in older]
