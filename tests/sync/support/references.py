"""Each policy slow and obvious: plain lists, no bookkeeping. What is fed must leave as from the engine."""

from itertools import product

from syncrelay.sync import Drop, DropReason, Match, Message, Outcome


def by_stamp(message):
    return message.stamp


class Queued:
    """Messages of all inputs, in one list by stamp."""

    def __init__(self, n_inputs, queue_size):
        self.n_inputs = n_inputs
        self.queue_size = queue_size
        self.queued: list[Message] = []
        self.left: list[Outcome] = []

    def of(self, index):
        return [message for message in self.queued if message.input == index]

    def replace(self, message):
        """Insert by stamp; whether it took the place of one of the same stamp."""
        same = [queued for queued in self.of(message.input) if queued.stamp == message.stamp]
        for queued in same:
            self.drop(queued, DropReason.DUPLICATE)
        self.queued = sorted([*self.queued, message], key=by_stamp)
        return bool(same)

    def drop(self, message, reason):
        self.queued.remove(message)
        self.left.append(Drop(message, reason))

    def match(self, members):
        for message in members:
            self.queued.remove(message)
        self.left.append(Match(tuple(members)))

    def drop_before(self, members, reason):
        for member in members:
            for queued in self.of(member.input):
                if queued.stamp < member.stamp:
                    self.drop(queued, reason)

    def drop_overflow(self, index):
        if len(self.of(index)) > self.queue_size:
            self.drop(self.of(index)[0], DropReason.OVERFLOW)

    def heads(self):
        return [self.of(index)[0] for index in range(self.n_inputs) if self.of(index)]

    def take(self, message):
        raise NotImplementedError

    def waiting(self):
        """How many sets wait for something better, or triggers for what is missing."""
        return 0

    def add(self, message):
        self.left = []
        self.take(message)
        return self.left


class ReferenceExactTime(Queued):
    def take(self, message):
        self.replace(message)
        members = [queued for queued in self.queued if queued.stamp == message.stamp]
        stamps = sorted({queued.stamp for queued in self.queued})
        if len(members) == self.n_inputs:
            self.drop_older(message.stamp, DropReason.SUPERSEDED)
            self.match(sorted(members, key=lambda member: member.input))
        elif len(stamps) > self.queue_size:
            self.drop_older(stamps[1], DropReason.OVERFLOW)

    def drop_older(self, stamp, reason):
        for queued in [queued for queued in self.queued if queued.stamp < stamp]:
            self.drop(queued, reason)


class ReferenceEager(Queued):
    def __init__(self, n_inputs, queue_size, slop_ns):
        super().__init__(n_inputs, queue_size)
        self.slop = slop_ns

    def take(self, message):
        if self.replace(message):
            return
        self.drop_too_far()
        fits = [
            members
            for members in product(*(self.of(index) for index in range(self.n_inputs)))
            if message in members and span(members) <= self.slop
        ]

        def near(members):
            return [(member.stamp > message.stamp, abs(member.stamp - message.stamp)) for member in members]

        if fits:
            best = min(fits, key=lambda members: (span(members), min(map(by_stamp, members)), near(members)))
            self.drop_before(best, DropReason.SUPERSEDED)
            self.match(best)
            self.drop_too_far()
        self.drop_overflow(message.input)
        self.drop_too_far()

    def drop_too_far(self):
        while far := [
            queued for queued in self.queued if any(head.stamp > queued.stamp + self.slop for head in self.heads())
        ]:
            self.drop(far[0], DropReason.TOO_FAR)


def span(members):
    stamps = [member.stamp for member in members]
    return max(stamps) - min(stamps)


class ReferenceEpsilon(Queued):
    def __init__(self, n_inputs, queue_size, epsilon_ns):
        super().__init__(n_inputs, queue_size)
        self.epsilon = epsilon_ns

    def take(self, message):
        if self.replace(message):
            return
        while len(self.heads()) == self.n_inputs:
            last = min(head.stamp for head in self.heads()) + self.epsilon
            near = [head for head in self.heads() if head.stamp <= last]
            if len(near) == self.n_inputs:
                self.match(near)
            else:
                for head in near:
                    self.drop(head, DropReason.TOO_FAR)
        self.drop_overflow(message.input)


class ReferenceLatest(Queued):
    def __init__(self, n_inputs, queue_size, trigger, max_ages_ns, required):
        super().__init__(n_inputs, queue_size)
        self.trigger = trigger
        self.max_ages = [float("inf") if age is None else age for age in max_ages_ns]
        self.required = required
        self.served = []

    def take(self, message):
        if any(served.input == message.input and served.stamp >= message.stamp for served in self.served):
            self.left.append(Drop(message, DropReason.LATE))
            return
        self.replace(message)
        while self.of(self.trigger) and self.serve(self.of(self.trigger)[0]):
            pass
        if len(self.of(message.input)) > self.queue_size:
            self.forget(self.of(message.input)[0], DropReason.OVERFLOW)

    def waiting(self):
        return len(self.of(self.trigger))

    def serve(self, trigger):
        found = [self.find(index, trigger) for index in range(self.n_inputs)]
        if "wait" in found and "never" not in found:
            return False
        if "never" in found:
            self.drop(trigger, DropReason.TOO_FAR)
        else:
            for index, member in enumerate(found):
                if member is not None:
                    for queued in self.of(index):
                        if queued.stamp < member.stamp:
                            self.forget(queued, DropReason.SUPERSEDED)
                    self.served.append(member)
            self.left.append(Match(tuple(found)))
            self.queued.remove(trigger)
            self.served.remove(trigger)
        for queued in list(self.queued):
            if queued.input != self.trigger and trigger.stamp - queued.stamp > self.max_ages[queued.input]:
                self.forget(queued, DropReason.EXPIRED)
        return True

    def find(self, index, trigger):
        fits = [queued for queued in self.of(index) if 0 <= trigger.stamp - queued.stamp <= self.max_ages[index]]
        if fits:
            return fits[-1]
        if not self.required[index]:
            return None
        return "never" if any(queued.stamp > trigger.stamp for queued in self.of(index)) else "wait"

    def forget(self, message, reason):
        if message in self.served:
            self.queued.remove(message)
            self.served = [served for served in self.served if served != message]
        else:
            self.drop(message, reason)


class ReferenceEqualKey(Queued):
    """Required inputs only."""

    def __init__(self, n_inputs, queue_size):
        super().__init__(n_inputs, queue_size)
        self.queues: list[list[Message]] = [[] for _ in range(n_inputs)]

    def add(self, message):
        left: list[Outcome] = []
        queue = self.queues[message.input]
        for queued in [queued for queued in queue if queued.key == message.key]:
            queue.remove(queued)
            left.append(Drop(queued, DropReason.DUPLICATE))
        queue.append(message)
        queue.sort(key=by_stamp)
        members = [[queued for queued in other if queued.key == message.key] for other in self.queues]
        if all(members):
            for other, (member,) in zip(self.queues, members, strict=True):
                older = other[: other.index(member)]
                left += [Drop(queued, DropReason.SUPERSEDED) for queued in older]
                del other[: len(older) + 1]
            left.append(Match(tuple(member for (member,) in members)))
        elif len(queue) > self.queue_size:
            left.append(Drop(queue.pop(0), DropReason.OVERFLOW))
        return left
