"""Each policy slow and obvious: plain lists, no bookkeeping. What is fed must leave as from the engine."""

from itertools import combinations, product
from operator import ge
from types import SimpleNamespace

from syncrelay.sync import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.latest_at_ticks import REST_NS


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


class Rooms:
    """How far apart messages of two inputs may be: as far as both may be off, half of slop at most."""

    def __init__(self, slop_ns, tolerances_ns, n_inputs):
        self.slop = float("inf") if slop_ns is None else slop_ns
        self.tolerances = tolerances_ns or [None] * n_inputs

    def has(self, one, other):
        """Whether two messages may be in one set."""
        return one.input == other.input or 2 * abs(one.stamp - other.stamp) <= self.twice_off(one) + self.twice_off(
            other
        )

    def twice_off(self, message):
        tolerance = self.tolerances[message.input]
        return self.slop if tolerance is None else min(2 * tolerance, self.slop)

    def twice_last(self, message):
        """Twice the last moment that it may be of, and its stamp, as the first may be off without end."""
        return 2 * message.stamp + self.twice_off(message), message.stamp

    def have(self, members):
        return all(self.has(one, other) for one, other in combinations(members, 2))


class ReferenceEager(Queued):
    def __init__(self, n_inputs, queue_size, slop_ns, tolerances_ns=None):
        super().__init__(n_inputs, queue_size)
        self.rooms = Rooms(slop_ns, tolerances_ns, n_inputs)
        self.is_narrowed = any(each is not None and 2 * each < self.rooms.slop for each in self.rooms.tolerances)

    def take(self, message):
        if self.replace(message):
            return
        self.drop_too_far()
        fits = [
            members
            for members in product(*(self.of(index) for index in range(self.n_inputs)))
            if message in members and self.rooms.have(members)
        ]

        def near(members):
            if self.is_narrowed:
                return list(map(by_stamp, members))
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
            queued
            for queued in self.queued
            if any(head.stamp > queued.stamp and not self.rooms.has(head, queued) for head in self.heads())
        ]:
            self.drop(far[0], DropReason.TOO_FAR)


def span(members):
    stamps = [member.stamp for member in members]
    return max(stamps) - min(stamps)


class ReferenceEpsilon(Queued):
    def __init__(self, n_inputs, queue_size, epsilon_ns, tolerances_ns=None):
        super().__init__(n_inputs, queue_size)
        self.rooms = Rooms(epsilon_ns, tolerances_ns, n_inputs)

    def take(self, message):
        if self.replace(message):
            return
        while len(self.heads()) == self.n_inputs:
            first = min(self.heads(), key=self.rooms.twice_last)
            near = [head for head in self.heads() if head.stamp <= first.stamp or self.rooms.has(head, first)]
            if len(near) == self.n_inputs:
                self.match(near)
            else:
                for head in near:
                    self.drop(head, DropReason.TOO_FAR)
        self.drop_overflow(message.input)


class ReferenceLatest(Queued):
    def __init__(self, n_inputs, queue_size, *, trigger, max_ages_ns, required, quorum=0):
        super().__init__(n_inputs, queue_size)
        self.trigger = trigger
        self.max_ages = [float("inf") if age is None else age for age in max_ages_ns]
        self.required, self.quorum = required, quorum
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
        may_come = [
            message is not None or all(queued.stamp <= trigger.stamp for queued in self.of(index))
            for index, message in enumerate(found)
        ]
        if not self.are_enough([message is not None for message in found]):
            if self.are_enough(may_come):
                return False
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
        return fits[-1] if fits else None

    def are_enough(self, there):
        are_required_there = all(is_there for is_there, needed in zip(there, self.required, strict=True) if needed)
        return are_required_there and sum(there) >= self.quorum

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


class ReferenceAtTicks:
    """At each tick the latest message of each input that is not too old, if the required ones have one."""

    by_clock = by_stamp = repeats = True

    def __init__(self, policy, options, required, quorum=0):
        self.n_inputs, self.options, self.required, self.quorum = policy.n_inputs, options, required, quorum
        self.ticks, self.policy = policy.ticks, policy
        self.queues: list[list[tuple[int, Message]]] = [[] for _ in range(self.n_inputs)]
        self.served: list[Message] = []
        self.passed, self.until, self.fed_until = -1, 0, -REST_NS

    def for_required(self, required, quorum):
        return ReferenceAtTicks(self.policy, self.options, required, quorum), SimpleNamespace(inputs=())

    def feed(self, place, stamp, message):
        self.fed_until = self.until
        left = self.drop(place, lambda old: old == stamp, DropReason.DUPLICATE)
        self.queues[place].append((stamp, message))
        self.queues[place].sort(key=lambda each: each[0])
        soonest = self.ticks.at(self.passed + 1)
        max_age = self.options.max_ages_ns[place]
        left += self.drop(place, lambda old: max_age is not None and soonest - old > max_age, DropReason.EXPIRED)
        # Of the messages between two ticks, or before the next one, a tick takes the last.
        last = {max(self.ticks.first_from(old), self.passed + 1): old for old, _ in self.queues[place]}
        left += self.drop(place, lambda old: old not in last.values(), DropReason.SUPERSEDED)
        if len(self.queues[place]) > self.options.queue_size:
            first = self.queues[place][0][0]
            left += self.drop(place, lambda old: old == first, DropReason.OVERFLOW)
        return left

    def drop(self, place, is_useless, reason):
        queue = self.queues[place]
        self.queues[place] = [each for each in queue if not is_useless(each[0])]
        gone = [message for stamp, message in queue if is_useless(stamp)]
        return [Drop(message, reason) for message in gone if message not in self.served]

    def taken(self, place, time):
        """The message of an input that a tick takes."""
        max_age = self.options.max_ages_ns[place]
        before = [each for each in self.queues[place] if each[0] <= time]
        return before[-1] if before and (max_age is None or time - before[-1][0] <= max_age) else (None, None)

    def next_tick(self):
        stamps = [stamp for queue in self.queues for stamp, _ in queue]
        # Once all have come, messages only grow older.
        end = min(self.ticks.first_from(max(stamps, default=0)), self.ticks.last_until(self.fed_until + REST_NS))
        for tick in range(self.passed + 1, max(end, self.passed + 1) + 1):
            time = self.ticks.at(tick)
            taken = [self.taken(place, time)[1] for place in range(self.n_inputs)]
            if time <= self.fed_until + REST_NS and self.has_required(taken):
                return time
        return None

    def has_required(self, taken):
        there = [message is not None for message in taken]
        return all(map(ge, there, self.required)) and sum(there) >= self.quorum

    def advance(self, until):
        self.begin_again_if_fallen(until)
        left = []
        while (time := self.next_tick()) is not None and time <= until:
            members = []
            for place in range(self.n_inputs):
                stamp, message = self.taken(place, time)
                if message is None:
                    left += self.drop(place, lambda old: old <= time, DropReason.EXPIRED)
                else:
                    left += self.drop(place, lambda old, stamp=stamp: old < stamp, DropReason.SUPERSEDED)
                    self.served.append(message)
                members.append(message)
            left.append(Match(tuple(members), tick=time))
            self.passed = self.ticks.last_until(time)
        self.passed = max(self.passed, self.ticks.last_until(until))
        return left

    def begin_again_if_fallen(self, until):
        if until < self.ticks.at(self.passed) - 1_000_000_000:
            self.passed = self.ticks.last_until(until)
            self.fed_until = min(self.fed_until, until)
        self.until = until

    def pass_over(self, until):
        self.begin_again_if_fallen(until)
        self.passed = max(self.passed, self.ticks.last_until(until))

    def let_go(self, reason):
        lasts = [queue[-1][0] if queue else None for queue in self.queues]
        return [
            drop
            for place, last in enumerate(lasts)
            for drop in self.drop(place, lambda old, last=last: old != last, reason)
        ]

    def flush(self, reason):
        return [drop for place in range(self.n_inputs) for drop in self.drop(place, lambda _: True, reason)]
