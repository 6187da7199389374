"""approximate_time, slow and obvious: message_filters' algorithm step by step, on sorted queues."""

from bisect import insort
from fractions import Fraction

from syncrelay.sync import Drop, DropReason, Match, Message, Outcome
from tests.sync.support.references import Rooms


class ReferenceApproximateTime:
    def __init__(self, *, n_inputs, queue_size, slop_ns, age_penalty=0.1, min_periods_ns=None, tolerances_ns=None):
        self.inputs = range(n_inputs)
        self.queue_size = queue_size
        self.rooms = Rooms(slop_ns, tolerances_ns, n_inputs)
        self.factor = Fraction(1.0 + age_penalty)
        self.bounds = min_periods_ns or [0] * n_inputs
        self.queues: list[list[Message]] = [[] for _ in self.inputs]
        self.overflowed = [False] * n_inputs
        self.rewind()

    def rewind(self):
        self.cursors = [0 for _ in self.inputs]
        self.pivot = None

    def waiting(self):
        return int(self.pivot is not None)

    def scale(self, duration):
        return int(duration * self.factor)

    def head(self, index):
        queue = self.queues[index]
        return queue[self.cursors[index]].stamp if self.cursors[index] < len(queue) else None

    def add(self, message):
        self.left: list[Outcome] = []
        queue = self.queues[message.input]
        for position, queued in enumerate(queue):
            if queued.stamp == message.stamp:
                queue[position] = message
                return [Drop(queued, DropReason.DUPLICATE)]
        head = self.head(message.input)
        before_head = bool(queue) and message.stamp < (queue[-1].stamp if head is None else head)
        insort(queue, message, key=lambda queued: queued.stamp)
        if before_head:
            self.rewind()
        self.search()
        if len(queue) > self.queue_size:
            had_candidate = self.pivot is not None
            self.rewind()
            self.left.append(Drop(queue.pop(0), DropReason.OVERFLOW))
            self.overflowed[message.input] = True
            if had_candidate:
                self.search()
        return self.left

    def search(self):
        while None not in (heads := [self.head(index) for index in self.inputs]):
            start, end = min(heads), max(heads)
            messages = [queue[cursor] for queue, cursor in zip(self.queues, self.cursors, strict=True)]
            goes = self.rooms.have(messages)
            first = heads.index(start) if goes else min(messages, key=self.rooms.twice_last).input
            last = max(index for index in self.inputs if heads[index] == end)
            self.overflowed = [lost and index == last for index, lost in enumerate(self.overflowed)]
            if self.pivot is None:
                if not goes or self.overflowed[last]:
                    self.left.append(Drop(self.queues[first].pop(0), DropReason.TOO_FAR))
                    continue
                self.pivot, self.pivot_stamp = last, end
                self.start, self.end = start, end
            elif goes and self.scale(end - self.end) < start - self.start:
                self.drop_skipped()
                self.start, self.end = start, end
            self.cursors[first] += 1
            seen_all = first == self.pivot or self.scale(end - self.end) >= self.pivot_stamp - self.start
            if seen_all or (None in map(self.head, self.inputs) and self.virtually_proved()):
                self.emit()

    def drop_skipped(self):
        for index, queue in enumerate(self.queues):
            for _ in range(self.cursors[index]):
                self.left.append(Drop(queue.pop(0), DropReason.SUPERSEDED))
            self.cursors[index] = 0

    def emit(self):
        self.left.append(Match(tuple(queue.pop(0) for queue in self.queues)))
        self.rewind()

    def virtually_proved(self):
        cursors = list(self.cursors)
        while True:
            heads = [
                queue[cursor].stamp if cursor < len(queue) else max(queue[-1].stamp + bound, self.pivot_stamp)
                for queue, cursor, bound in zip(self.queues, cursors, self.bounds, strict=True)
            ]
            start, end = min(heads), max(heads)
            if self.scale(end - self.end) >= self.pivot_stamp - self.start:
                return True
            if self.scale(end - self.end) < start - self.start:
                return False
            cursors[heads.index(start)] += 1
