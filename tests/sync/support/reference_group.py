"""What all policies share, slow and obvious: lateness and jumps, waits, optional inputs, thinning, common stamps."""

from dataclasses import replace
from typing import Any

from syncrelay.sync import Drop, DropReason, Match, Message, Outcome, Restamp

SECOND = 10**9


class ReferenceGroup:
    """A policy of the required inputs, with everything else that a group does done here, on plain lists."""

    def __init__(self, policy, *, required, max_wait_ns, offsets_ns, restamp, every, min_set_period_ns, stage):
        self.inputs = range(policy.n_inputs)
        self.policy, own = policy.for_required(required)
        self.by_clock, self.by_stamp, self.repeats = policy.by_clock, policy.by_stamp, policy.repeats
        self.required = [index for index in self.inputs if required[index]]
        self.optional = list(own.inputs)
        self.stage = stage(self.optional)
        self.max_wait, self.restamp = max_wait_ns, restamp
        self.offsets = offsets_ns or [0] * policy.n_inputs
        self.every, self.period = every, min_set_period_ns
        self.now = 0
        self.waits: list[int] = []
        self.waits_seen = (0, 0)
        self.begin()

    def begin(self):
        """Know nothing of the time before."""
        self.newest = [None for _ in self.inputs]
        self.given = [None for _ in self.inputs]
        self.before = [None for _ in self.inputs]
        self.jumped = 0
        self.n_sets, self.first, self.slot = 0, None, -1
        self.withheld: list[Message] = []
        self.passed: list[Message] = []

    def by(self, message):
        """The stamp to match by."""
        return message.stamp + self.offsets[message.input]

    def add(self, message, *, now):
        return [*self.expire(now=now), *self.leave(self.take(message), now)]

    def take(self, message):
        index, stamp = message.input, message.stamp
        if stamp == 0:
            return self.feed(message) if not self.by_stamp else [Drop(message, DropReason.UNSTAMPED)]
        if self.before[index] is not None:
            old, jumped = self.before[index], self.newest[self.jumped] + self.offsets[self.jumped]
            if old < stamp <= old + SECOND and self.by(message) > jumped + SECOND:
                return [Drop(message, DropReason.TIME_JUMP)]
            self.before[index] = None
        left: list[Outcome] = []
        if self.newest[index] is not None and stamp < self.newest[index] - SECOND:
            old = [self.newest[other] if self.before[other] is None else self.before[other] for other in self.inputs]
            left = self.empty(DropReason.TIME_JUMP)
            self.begin()
            self.jumped, self.before = index, old
            self.before[index] = None
        given = self.given[index]
        if given is not None and (stamp < given or (stamp == given and self.by_stamp)):
            return [*left, Drop(message, DropReason.LATE)]
        self.newest[index] = max(stamp, self.newest[index] or stamp)
        return left + self.feed(message)

    def feed(self, message):
        if message.input in self.optional:
            left = self.stage.put(message, self.by(message))
        else:
            place = [index for index in self.inputs if index not in self.optional].index(message.input)
            left = self.join(self.policy.feed(place, self.by(message), message))
        return left + self.due()

    def join(self, outcomes):
        """Have the sets of the policy wait for optional inputs. A wait counts from when it began in the policy."""
        if self.max_wait is None or self.by_clock:
            return list(outcomes)
        started, ended = (self.policy.waits_started, self.policy.waits_ended)
        self.waits += [self.now] * (started - self.waits_seen[0])
        over = [self.waits.pop(0) for _ in range(ended - self.waits_seen[1])]
        self.waits_seen = (started, ended)
        left: list[Outcome] = []
        for outcome in outcomes:
            if isinstance(outcome, Drop):
                left.append(outcome)
                continue
            self.give(outcome)
            members = list(filter(None, outcome.messages))
            left += self.stage.hold(members, list(map(self.by, members)), (over or [self.now])[0])
            over = []
        return left

    def next_deadline(self):
        if self.by_clock:
            tick = self.policy.next_tick()
            return None if tick is None else tick + (self.max_wait or 0)
        since = [each["since"] for each in self.stage.waiting] or self.waits
        return since[0] + self.max_wait if since and self.max_wait is not None else None

    def due(self):
        left: list[Outcome] = []
        if self.by_clock:
            return list(self.policy.advance(self.now - (self.max_wait or 0)))
        while (deadline := self.next_deadline()) is not None and deadline <= self.now:
            left += self.stage.leave() if self.stage.waiting else self.join(self.policy.release_oldest())
        return left

    def expire(self, *, now):
        self.waits = [min(since, now) for since in self.waits]
        for each in self.stage.waiting:
            each["since"] = min(each["since"], now)
        self.now = now
        return self.leave(self.due(), now)

    def pass_over(self, *, now):
        if self.by_clock:
            self.policy.pass_over(now - (self.max_wait or 0))

    def let_go(self, reason):
        drops = [*self.policy.let_go(reason), *self.stage.empty(reason)]
        self.join(())
        return drops

    def empty(self, reason):
        drops = [*self.policy.flush(reason), *self.stage.empty(reason)]
        self.join(())
        return drops + [Drop(message, reason) for message in self.withheld]

    def flush(self, reason):
        drops = self.empty(reason)
        self.begin()
        return drops

    def give(self, match):
        for message in filter(None, match.messages):
            given = self.given[message.input]
            self.given[message.input] = message.stamp if given is None else max(given, message.stamp)

    def leave(self, outcomes, now):
        left: list[Outcome] = []
        for outcome in outcomes:
            if isinstance(outcome, Drop):
                left.append(outcome)
                continue
            self.give(outcome)
            left += self.thin(outcome, now)
        return left

    def thin(self, match, now):
        members = list(filter(None, match.messages))
        stamps = [self.by(each) for each in members if each.input in self.required and each.stamp]
        passes = self.passes(match.tick if match.tick is not None else max(stamps, default=now))
        if not self.repeats:
            return [self.stamped(match)] if passes else [Drop(each, DropReason.THINNED) for each in members]
        useless = [each for each in self.withheld if each not in members]
        if passes:
            self.passed += members
        self.withheld = [each for each in members if each not in self.passed]
        return [Drop(each, DropReason.THINNED) for each in useless] + [self.stamped(match)] * passes

    def passes(self, moment):
        """Each `every`-th set passes, of these the first in each period; one may be a fourth of a period early."""
        self.n_sets += 1
        if (self.n_sets - 1) % self.every:
            return False
        if self.period is None:
            return True
        self.first = moment if self.first is None else self.first
        slot = (moment - self.first + self.period // 4) // self.period
        if slot <= self.slot:
            return False
        self.slot = slot
        return True

    def stamped(self, match):
        stamps = [message.stamp for message in match.messages if message is not None]
        chosen = None if not isinstance(self.restamp, int) else match.messages[self.restamp]
        if self.restamp is None:
            return match
        if chosen is not None:
            return replace(match, stamp=chosen.stamp)
        return replace(match, stamp=max(stamps) if self.restamp is Restamp.LATEST else min(stamps))


class Stage:
    """Sets that wait for optional inputs, the oldest first, and what these have sent."""

    is_same: Any
    """Whether one of two messages of an input replaces the other."""
    in_order: Any
    """Messages of an input, the first to overflow first."""
    best: Any
    """The message that an input has for the oldest set; None if there is none."""
    useless: Any
    """What of an input no later set can take."""
    is_decided: Any
    """Whether nothing that may still come is better than the best."""

    def __init__(self, optional, n_inputs, queue_size):
        self.optional, self.n_inputs, self.queue_size = optional, n_inputs, queue_size
        self.waiting: list[dict] = []
        self.queued: list[tuple[int, Message]] = []
        self.shown: dict[int, int] = {}

    def of(self, index):
        """The stamps that an input's messages are matched by, and these."""
        return [each for each in self.queued if each[1].input == index]

    def put(self, message, stamp):
        same = [each for each in self.of(message.input) if self.is_same(each, (stamp, message))]
        self.queued = [each for each in self.queued if each not in same] + [(stamp, message)]
        self.shown[message.input] = max(stamp, self.shown.get(message.input, stamp))
        left = [Drop(each, DropReason.DUPLICATE) for _, each in same] + self.leave_decided()
        if len(self.of(message.input)) > self.queue_size:
            left.append(self.drop(self.in_order(self.of(message.input))[0], DropReason.OVERFLOW))
        return left

    def hold(self, members, stamps, since):
        messages = [None] * self.n_inputs
        for message in members:
            messages[message.input] = message
        self.waiting.append({"messages": messages, "stamps": stamps, "since": since, "key": members[0].key})
        left = self.leave_decided()
        return left + self.leave() if len(self.waiting) > self.queue_size else left

    def leave_decided(self):
        left: list[Outcome] = []
        while self.waiting and all(self.is_decided(index) for index in self.optional):
            left += self.leave()
        return left

    def leave(self):
        waiting, drops = self.waiting[0], []
        messages, stamps = list(waiting["messages"]), list(waiting["stamps"])
        for index in self.optional:
            best = self.best(index, stamps)
            reason = DropReason.TOO_FAR if best is None else DropReason.SUPERSEDED
            drops += [self.drop(each, reason) for each in self.useless(index, best)]
            if best is not None:
                self.queued.remove(best)
                stamps.append(best[0])
                messages[index] = best[1]
        del self.waiting[0]
        return [*drops, Match(tuple(messages))]

    def drop(self, each, reason):
        self.queued.remove(each)
        return Drop(each[1], reason)

    def empty(self, reason):
        held = [message for waiting in self.waiting for message in waiting["messages"] if message is not None]
        drops = [Drop(message, reason) for message in held + [message for _, message in self.queued]]
        self.waiting, self.queued, self.shown = [], [], {}
        return drops


class ByStamp(Stage):
    """Each set takes the message nearest to its middle within slop, unless it is nearer to the next set."""

    def __init__(self, optional, n_inputs, queue_size, slop, steps):
        super().__init__(optional, n_inputs, queue_size)
        self.slop, self.steps = slop, steps

    def is_same(self, one, other):
        return one[0] == other[0]

    def in_order(self, queued):
        return sorted(queued, key=lambda each: each[0])

    def middles(self):
        """Twice the middle of the oldest set, and of the next."""
        return [min(each["stamps"]) + max(each["stamps"]) for each in self.waiting[:2]]

    def fits(self, stamp, stamps):
        oldest, *following = self.middles()
        near = max([*stamps, stamp]) - min([*stamps, stamp]) <= self.slop
        return near and all(2 * stamp - oldest <= other - 2 * stamp for other in following)

    def best(self, index, stamps):
        fitting = [each for each in self.of(index) if self.fits(each[0], stamps)]
        return min(fitting, key=lambda each: (abs(2 * each[0] - self.middles()[0]), each[0]), default=None)

    def useless(self, index, best):
        last = max(self.waiting[0]["stamps"]) - self.slop + 1 if best is None else best[0]
        return [each for each in self.in_order(self.of(index)) if each[0] < last]

    def is_decided(self, index):
        """Whether a message of the least stamp that may come is farther from the middle than the best, or too far."""
        if index not in self.shown:
            return False
        soonest = self.shown[index] + max(1, self.steps[index])
        best = self.best(index, self.waiting[0]["stamps"])
        if best is not None:
            return abs(2 * soonest - self.middles()[0]) >= abs(2 * best[0] - self.middles()[0]) and (
                2 * soonest >= self.middles()[0]
            )
        stamps = self.waiting[0]["stamps"]
        return soonest > max(stamps) - self.slop and not self.fits(soonest, stamps)


class ByKey(Stage):
    """Each set takes the message of its key."""

    def is_same(self, one, other):
        return one[1].key == other[1].key

    def in_order(self, queued):
        return queued

    def best(self, index, _):
        return next((each for each in self.of(index) if each[1].key == self.waiting[0]["key"]), None)

    def useless(self, index, best):
        queued = self.of(index)
        if best is None:
            return []
        place = queued.index(best)
        return [each for number, each in enumerate(queued) if number < place or each[1].stamp < best[1].stamp]

    def is_decided(self, index):
        return any(each[1].key == waiting["key"] for each in self.of(index) for waiting in self.waiting)
