"""The stages where messages of inputs that may be missing join sets: by stamps, and by keys."""

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.queues import StampQueue
from syncrelay.sync.waiting import OptionalStage, Seed, Waiting
from syncrelay.sync.windows import Tolerances, windows_of

_EARLIEST: Final = -(2**63)


class _Last(NamedTuple):
    """The last set: the stamp that it was made round, the last moment that its messages share, its inputs."""

    stamp: int
    close: int
    inputs: frozenset[int]


class OptionalInputs(OptionalStage):
    """Adds to each set, for each optional input, the message nearest to the middle of the set that may be in it.

    It is decided when no later message of any optional input can be nearer. A message goes to the nearer of two sets
    that wait. It is superseded when a newer one of its input went into a set, and too far when it is too old for every
    set to come.

    Where no input is required, a set is made round a message: where enough inputs have messages within slop, that of
    the first of them in their order. So sets are made round the messages of the first input while these come. A message
    that is not newer than the one that the last set was made round is late, and those that the last set left without
    make none of their own.
    """

    def __init__(
        self,
        *,
        required: Sequence[bool],
        quorum: int,
        queue_size: int,
        slop_ns: int,
        min_periods_ns: Sequence[int] | None = None,
        tolerances_ns: Tolerances = None,
    ) -> None:
        self.inputs = [index for index, needed in enumerate(required) if not needed]
        self.lacking = quorum - sum(required)
        self.queue_size = queue_size
        self.waiting = deque()
        self.came = {index: {} for index in self.inputs}
        self._queues = {index: StampQueue() for index in self.inputs}
        self._windows = windows_of(slop_ns, tolerances_ns, len(required))
        self._least_steps = [max(1, period) for period in min_periods_ns or (1,) * len(required)]
        self._newest: dict[int, int] = {}
        self._is_any = not any(required)
        self._nothing = (None,) * len(required)
        self._last: _Last | None = None

    def put(self, index: int, stamp: int, message: Message, now: int) -> list[Outcome]:
        if self._last is not None and stamp <= self._last.stamp:
            return [Drop(message, DropReason.LATE)]
        queue = self._queues[index]
        outcomes: list[Outcome] = []
        replaced = queue.insert(stamp, message)
        if replaced is not None:
            outcomes.append(Drop(replaced, DropReason.DUPLICATE))
        self.came[index].setdefault(stamp, now)
        self._newest[index] = max(stamp, self._newest.get(index, stamp))
        outcomes += self.leave_decided()
        if self._is_any:
            outcomes += self._drop_alone()
        if len(queue) > self.queue_size:
            outcomes += self._drop(index, 1, DropReason.OVERFLOW)
        return outcomes

    def oldest(self) -> Seed | None:
        return next(self._around_messages(), None) if self._is_any else super().oldest()

    def seeds(self) -> Iterator[Seed]:
        return self._around_messages() if self._is_any else super().seeds()

    def chosen(self, seed: Seed) -> dict[int, int]:
        waiting, _ = seed
        begin, close = self._shared(waiting)
        chosen = {}
        for index, queue in self._queues.items():
            position = self._nearest(seed, index, begin, close)
            if position is not None:
                stamp = chosen[index] = queue.stamps[position]
                first, last = self._windows[index].around(stamp)
                begin, close = max(begin, first), min(close, last)
        return chosen

    def complete(self, seed: Seed) -> list[Outcome]:
        waiting, _ = seed
        messages, chosen = list(waiting.messages), self.chosen(seed)
        begin, _ = self._shared(waiting)
        if self._is_any:
            close = min(stamp + self._windows[index].after for index, stamp in chosen.items())
            self._last = _Last(waiting.low, close, frozenset(chosen))
        drops: list[Drop] = []
        for index, queue in self._queues.items():
            if index in chosen:
                drops += self._drop(index, bisect_left(queue.stamps, chosen[index]), DropReason.SUPERSEDED)
                del self.came[index][chosen[index]]
                messages[index] = queue.remove(0)
            else:
                useless = waiting.low if self._is_any else begin - self._windows[index].after
                drops += self._drop(index, bisect_right(queue.stamps, useless), DropReason.TOO_FAR)
        if self.waiting:
            self.waiting.popleft()
        return [*drops, Match(tuple(messages))]

    def is_decided(self, seed: Seed) -> bool:
        return all(self._is_decided(index, seed) for index in self.inputs)

    def flush(self, reason: DropReason) -> list[Drop]:
        self._last = None
        return super().flush(reason)

    def empty(self) -> list[Message]:
        self._newest.clear()
        return [message for queue in self._queues.values() for message in queue.take(len(queue))]

    def _is_decided(self, index: int, seed: Seed) -> bool:
        newest = self._newest.get(index)
        if newest is None:
            return False
        waiting, following = seed
        next_stamp = newest + self._least_steps[index]
        begin, close = self._shared(waiting)
        position = self._nearest(seed, index, begin, close)
        if position is None:
            return next_stamp > self._last_fitting(waiting, following, index, close)
        mirrored = waiting.low + waiting.high - self._queues[index].stamps[position]
        return next_stamp >= mirrored

    def _shared(self, waiting: Waiting) -> tuple[int, int]:
        """Return the first and the last moment that what a set is made round shares."""
        firsts, lasts = zip(
            *[self._windows[index].around(stamp) for index, stamp in waiting.stamps.items()], strict=True
        )
        return max(firsts), min(lasts)

    def _nearest(self, seed: Seed, index: int, begin: int, close: int) -> int | None:
        """Return the place of an input's stamp nearest to the set's middle, of those whose window meets the set's.

        Of two that are equally near, it is the older.
        """
        waiting, following = seed
        stamps = self._queues[index].stamps
        first = bisect_left(stamps, begin - self._windows[index].after)
        end = bisect_right(stamps, self._last_fitting(waiting, following, index, close))
        if first >= end:
            return None
        after = min(max(bisect_left(stamps, -(-(waiting.low + waiting.high) // 2)), first), end - 1)
        before = max(after - 1, first)
        is_after = 2 * stamps[after] - waiting.low - waiting.high
        is_before = waiting.low + waiting.high - 2 * stamps[before]
        return after if abs(is_after) < abs(is_before) else before

    def _last_fitting(self, waiting: Waiting, following: Waiting | None, index: int, close: int) -> int:
        """Return the last stamp of an input whose window begins by `close` and which is not nearer to the next set."""
        last = close + self._windows[index].before
        if following is not None:
            last = min(last, (waiting.low + waiting.high + following.low + following.high) // 4)
        return last

    def _around_messages(self) -> Iterator[Seed]:
        """Yield the sets that may leave where no input is required, the oldest first."""
        places = dict.fromkeys(self.inputs, 0)
        while True:
            stamps = {index: self._queues[index].stamps for index in places}
            heads = {index: stamps[index][place] for index, place in places.items() if place < len(stamps[index])}
            if len(heads) < self.lacking:
                return
            windows = {index: self._windows[index].around(head) for index, head in heads.items()}
            begin = sorted(first for first, _ in windows.values())[self.lacking - 1]
            close = min(last for _, last in windows.values())
            if close < begin:
                # No set of enough inputs holds what ends before.
                places = {
                    index: bisect_left(stamps[index], begin - self._windows[index].after, places[index])
                    for index in heads
                }
                continue
            leader = _leader(windows, close)
            place = places[leader]
            here, *following = [self._around(stamp, leader) for stamp in stamps[leader][place : place + 2]]
            seed = here, following[0] if following else None
            if self._since(seed) is not None and self._is_new(seed):
                yield seed
            places[leader] = place + 1

    def _around(self, stamp: int, leader: int) -> Waiting:
        return Waiting(self._nothing, {leader: stamp}, stamp, stamp, _EARLIEST)

    def _is_new(self, seed: Seed) -> bool:
        """Whether a set is of another moment than the last, and not of those that were missing there."""
        last = self._last
        return last is None or any(
            index in last.inputs or stamp - self._windows[index].before > last.close
            for index, stamp in self.chosen(seed).items()
        )

    def _drop_alone(self) -> list[Drop]:
        """Drop the oldest messages that can be in no set of enough inputs any more."""
        drops: list[Drop] = []
        while closes := {
            index: queue.stamps[0] + self._windows[index].after for index, queue in self._queues.items() if queue.stamps
        }:
            index = min(closes, key=closes.__getitem__)
            lasts = {other: closes[index] + self._windows[other].before for other in self.inputs}
            if sum(self._may_have(other, last) for other, last in lasts.items()) >= self.lacking:
                break
            drops += self._drop(index, 1, DropReason.TOO_FAR)
        return drops

    def _may_have(self, index: int, last: int) -> bool:
        """Whether an input has or may still send a message up to this stamp."""
        stamps, newest = self._queues[index].stamps, self._newest.get(index)
        return newest is None or newest + self._least_steps[index] <= last or (bool(stamps) and stamps[0] <= last)

    def _drop(self, index: int, count: int, reason: DropReason) -> list[Drop]:
        if not count:
            return []
        queue = self._queues[index]
        for stamp in queue.stamps[:count]:
            del self.came[index][stamp]
        return queue.drop(count, reason)


def _leader(windows: Mapping[int, tuple[int, int]], close: int) -> int:
    """Return the first input whose window meets the one that ends first, at `close`, or one that meets that."""
    leader = max(windows)
    for index, (first, last) in reversed(list(windows.items())):
        if first <= close:
            leader, close = index, last
    return leader


class OptionalKeys(OptionalStage):
    """Adds to each set, for each optional input, the message of its key.

    It is decided when each optional input has sent its key or that of a later set that waits. When a message leaves in
    a set, those of its input that came before it or have an older stamp are superseded.
    """

    def __init__(self, *, required: Sequence[bool], quorum: int, queue_size: int) -> None:
        self.inputs = [index for index, needed in enumerate(required) if not needed]
        self.lacking = quorum - sum(required)
        self.queue_size = queue_size
        self.waiting = deque()
        self.came = {index: {} for index in self.inputs}
        self._queues: dict[int, dict[Hashable, Message]] = {index: {} for index in self.inputs}

    def put(self, index: int, stamp: int, message: Message, now: int) -> list[Outcome]:
        del stamp
        queue = self._queues[index]
        replaced = queue.pop(message.key, None)
        outcomes: list[Outcome] = [] if replaced is None else [Drop(replaced, DropReason.DUPLICATE)]
        queue[message.key] = message
        self.came[index].setdefault(message.key, now)
        outcomes += self.leave_decided()
        if len(queue) > self.queue_size:
            outcomes.append(Drop(self._take(index, next(iter(queue))), DropReason.OVERFLOW))
        return outcomes

    def chosen(self, seed: Seed) -> dict[int, Hashable]:
        key = _key(seed[0])
        return {index: key for index, queue in self._queues.items() if key in queue}

    def complete(self, seed: Seed) -> list[Outcome]:
        waiting, _ = seed
        messages = list(waiting.messages)
        drops: list[Drop] = []
        for index, key in self.chosen(seed).items():
            queue = self._queues[index]
            keys, member = list(queue), queue[key]
            position = keys.index(key)
            older = keys[:position] + [other for other in keys[position:] if queue[other].stamp < member.stamp]
            drops += [Drop(self._take(index, other), DropReason.SUPERSEDED) for other in older]
            messages[index] = self._take(index, key)
        self.waiting.popleft()
        return [*drops, Match(tuple(messages))]

    def is_decided(self, seed: Seed) -> bool:
        del seed
        keys = [_key(waiting) for waiting in self.waiting]
        return all(any(key in queue for key in keys) for queue in self._queues.values())

    def empty(self) -> list[Message]:
        queued = [message for queue in self._queues.values() for message in queue.values()]
        for queue in self._queues.values():
            queue.clear()
        return queued

    def _take(self, index: int, key: Hashable) -> Message:
        del self.came[index][key]
        return self._queues[index].pop(key)


def _key(waiting: Waiting) -> Hashable:
    return next(message.key for message in waiting.messages if message is not None)
