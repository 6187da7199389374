"""The stages where sets of the required inputs wait for messages of the optional ones: by stamps, and by keys."""

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Hashable, Mapping, Sequence, Sized
from typing import NamedTuple, Protocol

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.queues import StampQueue


class Waiting(NamedTuple):
    """A set of the required inputs: None for the optional ones, its least and greatest stamp, when its wait began."""

    messages: tuple[Message | None, ...]
    low: int
    high: int
    since: int


class OptionalStage(Protocol):
    """Adds messages of the optional `inputs` to the sets of the required ones, which leave in the order they come.

    A set leaves when it is decided what it takes, when `queue_size` sets wait behind it, or when `leave` is called.
    """

    inputs: Sequence[int]
    queue_size: int
    waiting: deque[Waiting]
    queues: Mapping[int, Sized]

    @property
    def oldest_since(self) -> int | None:
        """When the oldest set began to wait."""
        return self.waiting[0].since if self.waiting else None

    def wait_from(self, now: int) -> None:
        """Let no wait have begun later than `now`, because the clock fell."""
        self.waiting = deque(waiting._replace(since=min(waiting.since, now)) for waiting in self.waiting)

    def hold(self, waiting: Waiting) -> list[Outcome]:
        """Take a set of the required inputs; return what leaves."""
        self.waiting.append(waiting)
        outcomes = self.leave_decided()
        if len(self.waiting) > self.queue_size:
            outcomes += self.leave()
        return outcomes

    def leave_decided(self) -> list[Outcome]:
        """Let sets leave while nothing that may still come changes the oldest one."""
        outcomes: list[Outcome] = []
        while self.waiting and all(self.is_decided(index) for index in self.inputs):
            outcomes += self.leave()
        return outcomes

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop everything, and be as new."""
        held = [message for waiting in self.waiting for message in waiting.messages if message is not None]
        self.waiting.clear()
        return [Drop(message, reason) for message in held + self.empty()]

    def buffered(self, index: int) -> int:
        """How many messages of this input, required or not, are in here."""
        return sum(waiting.messages[index] is not None for waiting in self.waiting) + len(self.queues.get(index, ()))

    def put(self, index: int, stamp: int, message: Message) -> list[Outcome]:
        """Take a message of an optional input; return what leaves because of it."""
        ...

    def leave(self) -> list[Outcome]:
        """Let the oldest set leave with what there is."""
        ...

    def is_decided(self, index: int) -> bool:
        """Whether no later message of this input can be better for the oldest set than the best one so far."""
        ...

    def empty(self) -> list[Message]:
        """Return all messages of optional inputs, and forget what these have sent."""
        ...


class OptionalInputs(OptionalStage):
    """Adds to each set, for each optional input, the message nearest to the middle of the set, within slop.

    It is decided when no later message of any optional input can be nearer. A message goes to the nearer of two sets
    that wait. It is superseded when a newer one of its input went into a set, and too far when it is too old for every
    set to come.
    """

    def __init__(
        self,
        *,
        required: Sequence[bool],
        queue_size: int,
        slop_ns: int,
        min_periods_ns: Sequence[int] | None = None,
    ) -> None:
        self.inputs = [index for index, needed in enumerate(required) if not needed]
        self.queue_size = queue_size
        self.queues: dict[int, StampQueue] = {index: StampQueue() for index in self.inputs}
        self.waiting = deque()
        self._slop = slop_ns
        self._least_steps = [max(1, period) for period in min_periods_ns or (1,) * len(required)]
        self._newest: dict[int, int] = {}

    def put(self, index: int, stamp: int, message: Message) -> list[Outcome]:
        queue = self.queues[index]
        outcomes: list[Outcome] = []
        replaced = queue.insert(stamp, message)
        if replaced is not None:
            outcomes.append(Drop(replaced, DropReason.DUPLICATE))
        self._newest[index] = max(stamp, self._newest.get(index, stamp))
        outcomes += self.leave_decided()
        if len(queue) > self.queue_size:
            outcomes += queue.drop(1, DropReason.OVERFLOW)
        return outcomes

    def leave(self) -> list[Outcome]:
        waiting = self.waiting[0]
        messages = list(waiting.messages)
        low, high = waiting.low, waiting.high
        drops: list[Drop] = []
        for index, queue in self.queues.items():
            position = self._nearest(waiting, queue.stamps, low, high)
            if position is None:
                drops += queue.drop(bisect_right(queue.stamps, waiting.high - self._slop), DropReason.TOO_FAR)
                continue
            low, high = min(low, queue.stamps[position]), max(high, queue.stamps[position])
            drops += queue.drop(position, DropReason.SUPERSEDED)
            messages[index] = queue.remove(0)
        self.waiting.popleft()
        return [*drops, Match(tuple(messages))]

    def is_decided(self, index: int) -> bool:
        newest = self._newest.get(index)
        if newest is None:
            return False
        waiting = self.waiting[0]
        next_stamp = newest + self._least_steps[index]
        stamps = self.queues[index].stamps
        position = self._nearest(waiting, stamps, waiting.low, waiting.high)
        if position is None:
            return next_stamp > self._last_fitting(waiting, waiting.low)
        mirrored = waiting.low + waiting.high - stamps[position]
        return next_stamp >= mirrored

    def empty(self) -> list[Message]:
        self._newest.clear()
        return [message for queue in self.queues.values() for message in queue.take(len(queue))]

    def _nearest(self, waiting: Waiting, stamps: list[int], low: int, high: int) -> int | None:
        """Return the place of the stamp nearest to the set's middle within slop; of two equally near, the older."""
        first = bisect_left(stamps, high - self._slop)
        end = bisect_right(stamps, self._last_fitting(waiting, low))
        if first >= end:
            return None
        after = min(max(bisect_left(stamps, -(-(waiting.low + waiting.high) // 2)), first), end - 1)
        before = max(after - 1, first)
        is_after = 2 * stamps[after] - waiting.low - waiting.high
        is_before = waiting.low + waiting.high - 2 * stamps[before]
        return after if abs(is_after) < abs(is_before) else before

    def _last_fitting(self, waiting: Waiting, low: int) -> int:
        """Return the last stamp within slop of `low` that is not nearer to the next waiting set."""
        last = low + self._slop
        if len(self.waiting) > 1:
            following = self.waiting[1]
            last = min(last, (waiting.low + waiting.high + following.low + following.high) // 4)
        return last


class OptionalKeys(OptionalStage):
    """Adds to each set, for each optional input, the message of its key.

    It is decided when each optional input has sent its key or that of a later set that waits. When a message leaves in
    a set, those of its input that came before it or have an older stamp are superseded.
    """

    def __init__(self, *, required: Sequence[bool], queue_size: int) -> None:
        self.inputs = [index for index, needed in enumerate(required) if not needed]
        self.queue_size = queue_size
        self.queues: dict[int, dict[Hashable, Message]] = {index: {} for index in self.inputs}
        self.waiting = deque()

    def put(self, index: int, stamp: int, message: Message) -> list[Outcome]:
        del stamp
        queue = self.queues[index]
        replaced = queue.pop(message.key, None)
        outcomes: list[Outcome] = [] if replaced is None else [Drop(replaced, DropReason.DUPLICATE)]
        queue[message.key] = message
        outcomes += self.leave_decided()
        if len(queue) > self.queue_size:
            outcomes.append(Drop(queue.pop(next(iter(queue))), DropReason.OVERFLOW))
        return outcomes

    def leave(self) -> list[Outcome]:
        waiting = self.waiting.popleft()
        messages = list(waiting.messages)
        drops: list[Drop] = []
        for index, queue in self.queues.items():
            member = messages[index] = queue.get(_key(waiting))
            if member is not None:
                keys = list(queue)
                position = keys.index(member.key)
                older = keys[:position] + [key for key in keys[position:] if queue[key].stamp < member.stamp]
                drops += [Drop(queue.pop(key), DropReason.SUPERSEDED) for key in older]
                del queue[member.key]
        return [*drops, Match(tuple(messages))]

    def is_decided(self, index: int) -> bool:
        return any(_key(waiting) in self.queues[index] for waiting in self.waiting)

    def empty(self) -> list[Message]:
        queued = [message for queue in self.queues.values() for message in queue.values()]
        for queue in self.queues.values():
            queue.clear()
        return queued


def _key(waiting: Waiting) -> Hashable:
    return next(message.key for message in waiting.messages if message is not None)
