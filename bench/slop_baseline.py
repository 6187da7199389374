"""A plain Python synchronizer by slop, for comparison, which behaves as that of message_filters.

Written from its semantics: a map of stamps per input, the candidates of every other input by distance, the
product of the candidates walked until one fits within slop. Stamps are ints, its best case, or objects
that check their types, as ROS users have them.
"""

from functools import total_ordering
from itertools import product


@total_ordering
class Stamp:
    """A time or a duration in nanoseconds."""

    def __init__(self, nanoseconds):
        self.nanoseconds = nanoseconds

    def __eq__(self, other):
        return isinstance(other, Stamp) and self.nanoseconds == other.nanoseconds

    def __lt__(self, other):
        if not isinstance(other, Stamp):
            return NotImplemented
        return self.nanoseconds < other.nanoseconds

    def __sub__(self, other):
        if not isinstance(other, Stamp):
            return NotImplemented
        return Stamp(self.nanoseconds - other.nanoseconds)

    def __abs__(self):
        return Stamp(abs(self.nanoseconds))

    def __hash__(self):
        return hash(self.nanoseconds)


class SlopSynchronizer:
    def __init__(self, n_inputs, queue_size, slop, stamp_type):
        self.queues: list[dict] = [{} for _ in range(n_inputs)]
        self.queue_size = queue_size
        self.slop = stamp_type(slop)
        self.stamp_type = stamp_type

    def add(self, message):
        stamp = self.stamp_type(message.stamp)
        own = self.queues[message.input]
        own[stamp] = message
        while len(own) > self.queue_size:
            del own[min(own)]
        candidates = []
        for index, queue in enumerate(self.queues):
            if index == message.input:
                candidates.append([stamp])
                continue
            near = sorted((abs(other - stamp), other) for other in queue if abs(other - stamp) <= self.slop)
            if not near:
                return None
            candidates.append([other for _, other in near])
        for stamps in product(*candidates):
            if max(stamps) - min(stamps) < self.slop and stamp in own:
                return [queue.pop(other) for queue, other in zip(self.queues, stamps, strict=True)]
        return None
