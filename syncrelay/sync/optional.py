"""The stage where sets of the required inputs wait for messages of the optional ones, by stamps."""

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.policy import OptionalStage
from syncrelay.sync.queues import StampQueue


class _Waiting(NamedTuple):
    """A set of the required inputs: None for the optional ones, its least and greatest stamp, when its wait began."""

    messages: tuple[Message | None, ...]
    low: int
    high: int
    since: int


class OptionalInputs(OptionalStage):
    """Adds to each set, for each optional input, the message nearest to the middle of the set, within slop.

    Sets leave in the order they come; at once if there are no optional inputs. A set leaves when no later message of
    any optional input can be nearer, or when `leave` is called. A message goes to the nearer of two sets that wait. It
    is superseded when a newer one of its input went into a set, and too far when it is too old for every set to come.
    """

    __slots__ = ("_least_steps", "_newest", "_queue_size", "_queues", "_slop", "_waiting", "inputs")

    def __init__(
        self,
        *,
        required: Sequence[bool],
        queue_size: int,
        slop_ns: int,
        min_periods_ns: Sequence[int] | None = None,
    ) -> None:
        self.inputs: Sequence[int] = [index for index, needed in enumerate(required) if not needed]
        self._queue_size = queue_size
        self._slop = slop_ns
        self._least_steps = [max(1, period) for period in min_periods_ns or (1,) * len(required)]
        self._queues = {index: StampQueue() for index in self.inputs}
        self._newest: dict[int, int] = {}
        self._waiting: deque[_Waiting] = deque()

    @property
    def oldest_since(self) -> int | None:
        return self._waiting[0].since if self._waiting else None

    def wait_from(self, now: int) -> None:
        self._waiting = deque(waiting._replace(since=min(waiting.since, now)) for waiting in self._waiting)

    def put(self, index: int, stamp: int, message: Message) -> list[Outcome]:
        queue = self._queues[index]
        outcomes: list[Outcome] = []
        replaced = queue.insert(stamp, message)
        if replaced is not None:
            outcomes.append(Drop(replaced, DropReason.DUPLICATE))
        self._newest[index] = max(stamp, self._newest.get(index, stamp))
        outcomes += self._leave_decided()
        if len(queue.stamps) > self._queue_size:
            outcomes += [Drop(lost, DropReason.OVERFLOW) for lost in queue.take(1)]
        return outcomes

    def hold(self, messages: tuple[Message | None, ...], low: int, high: int, since: int) -> list[Outcome]:
        self._waiting.append(_Waiting(messages, low, high, since))
        outcomes = self._leave_decided()
        if len(self._waiting) > self._queue_size:
            outcomes += self.leave()
        return outcomes

    def leave(self) -> list[Outcome]:
        waiting = self._waiting[0]
        messages = list(waiting.messages)
        low, high = waiting.low, waiting.high
        drops: list[Drop] = []
        for index in self.inputs:
            queue = self._queues[index]
            position = self._nearest(waiting, queue.stamps, low, high)
            if position is None:
                useless = bisect_right(queue.stamps, waiting.high - self._slop)
                drops += [Drop(message, DropReason.TOO_FAR) for message in queue.take(useless)]
                continue
            low, high = min(low, queue.stamps[position]), max(high, queue.stamps[position])
            *older, messages[index] = queue.take(position + 1)
            drops += [Drop(message, DropReason.SUPERSEDED) for message in older]
        self._waiting.popleft()
        return [*drops, Match(tuple(messages))]

    def flush(self, reason: DropReason) -> list[Drop]:
        held = [message for waiting in self._waiting for message in waiting.messages if message is not None]
        queued = [message for queue in self._queues.values() for message in queue.take(len(queue.stamps))]
        self._waiting.clear()
        self._newest.clear()
        return [Drop(message, reason) for message in held + queued]

    def buffered(self, index: int) -> int:
        held = sum(waiting.messages[index] is not None for waiting in self._waiting)
        return held + (len(self._queues[index].stamps) if index in self._queues else 0)

    def _leave_decided(self) -> list[Outcome]:
        outcomes: list[Outcome] = []
        while self._waiting and all(self._is_decided(index) for index in self.inputs):
            outcomes += self.leave()
        return outcomes

    def _is_decided(self, index: int) -> bool:
        """Whether no later message of this input can be better for the oldest set than the best one so far."""
        newest = self._newest.get(index)
        if newest is None:
            return False
        waiting = self._waiting[0]
        next_stamp = newest + self._least_steps[index]
        stamps = self._queues[index].stamps
        position = self._nearest(waiting, stamps, waiting.low, waiting.high)
        if position is None:
            return next_stamp > self._last_fitting(waiting, waiting.low)
        mirrored = waiting.low + waiting.high - stamps[position]
        return next_stamp >= mirrored

    def _nearest(self, waiting: _Waiting, stamps: list[int], low: int, high: int) -> int | None:
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

    def _last_fitting(self, waiting: _Waiting, low: int) -> int:
        """Return the last stamp within slop of `low` that is not nearer to the next waiting set."""
        last = low + self._slop
        if len(self._waiting) > 1:
            following = self._waiting[1]
            last = min(last, (waiting.low + waiting.high + following.low + following.high) // 4)
        return last
