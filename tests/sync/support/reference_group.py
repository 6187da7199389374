"""What all policies share, slow and obvious: lateness and jumps, waits, optional inputs, thinning, common stamps."""

from dataclasses import replace
from typing import Any

from syncrelay.sync import Drop, DropReason, Match, Message, Outcome, Restamp

SECOND = 10**9
START_OF_TIME = 2**63


class ReferenceGroup:
    """A policy of the required inputs, with everything else that a group does done here, on plain lists."""

    def __init__(self, policy, *, required, quorum, max_wait_ns, offsets_ns, restamp, every, min_set_period_ns, stage):
        self.inputs = range(policy.n_inputs)
        self.policy, own = policy.for_required(required, quorum)
        self.by_clock, self.by_stamp, self.repeats = policy.by_clock, policy.by_stamp, policy.repeats
        self.required = [index for index in self.inputs if required[index]]
        self.optional = list(own.inputs)
        self.stage = stage(self.optional)
        self.stage.quorum = quorum
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
            self.stage.last = None
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
            left = self.stage.put(message, self.by(message), self.now)
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
        since = sorted(map(self.stage.since, self.stage.sets())) or self.waits
        return since[0] + self.max_wait if since and self.max_wait is not None else None

    def due(self):
        left: list[Outcome] = []
        if self.by_clock:
            return list(self.policy.advance(self.now - (self.max_wait or 0)))
        while (deadline := self.next_deadline()) is not None and deadline <= self.now:
            left += self.stage.leave() if self.stage.sets() else self.join(self.policy.release_oldest())
        return left

    def expire(self, *, now):
        self.waits = [min(since, now) for since in self.waits]
        for each in self.stage.waiting:
            each["since"] = min(each["since"], now)
        self.stage.came = {which: min(came, now) for which, came in self.stage.came.items()}
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
        self.stage.last = None
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
        if not self.required:
            stamps = [self.by(members[0])]
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
        if self.restamp is Restamp.TICK:
            return replace(match, stamp=match.tick)
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

    quorum: int

    def __init__(self, optional, n_inputs, queue_size):
        self.optional, self.n_inputs, self.queue_size = optional, n_inputs, queue_size
        self.waiting: list[dict] = []
        self.queued: list[tuple[int, Message]] = []
        self.shown: dict[int, int] = {}
        self.came: dict[tuple, int] = {}
        self.last: tuple | None = None

    @property
    def is_any(self):
        """Whether no input is required."""
        return len(self.optional) == self.n_inputs

    def of(self, index):
        """The stamps that an input's messages are matched by, and these."""
        return [each for each in self.queued if each[1].input == index]

    def which(self, each):
        """What tells a message from all others that are queued."""
        stamp, message = each
        return message.input, message.key if isinstance(self, ByKey) else stamp

    def put(self, message, stamp, now):
        if self.last is not None and stamp <= self.last[0]:
            return [Drop(message, DropReason.LATE)]
        same = [each for each in self.of(message.input) if self.is_same(each, (stamp, message))]
        # One that has left is not there while another of its key or stamp comes.
        self.came = {which: came for which, came in self.came.items() if which in map(self.which, self.queued)}
        self.queued = [each for each in self.queued if each not in same] + [(stamp, message)]
        self.came.setdefault(self.which((stamp, message)), now)
        self.shown[message.input] = max(stamp, self.shown.get(message.input, stamp))
        left = [Drop(each, DropReason.DUPLICATE) for _, each in same] + self.leave_decided() + self.drop_alone()
        if len(self.of(message.input)) > self.queue_size:
            left.append(self.drop(self.in_order(self.of(message.input))[0], DropReason.OVERFLOW))
        return left

    def hold(self, members, stamps, since):
        messages = [None] * self.n_inputs
        for message in members:
            messages[message.input] = message
        there = list(zip(stamps, [message.input for message in members], strict=True))
        self.waiting.append(
            {"messages": messages, "stamps": stamps, "there": there, "since": since, "key": members[0].key}
        )
        left = self.leave_decided()
        return left + self.leave() if len(self.waiting) > self.queue_size else left

    def all(self):
        """What sets may be made round, the oldest first, each with what the next one is made round."""
        return [{**one, "next": other} for one, other in zip(self.waiting, [*self.waiting[1:], None], strict=False)]

    def sets(self):
        """Those that have enough messages."""
        return [each for each in self.all() if self.since(each) is not None]

    def taken(self, seed):
        """The messages that a set takes of the optional inputs."""
        there, taken = list(seed["there"]), {}
        for index in self.optional:
            best = self.best(index, seed, there)
            if best is not None:
                taken[index] = best
                there.append((best[0], index))
        return taken

    def since(self, seed):
        there = [seed["since"] for message in seed["messages"] if message is not None]
        there += sorted(self.came[self.which(each)] for each in self.taken(seed).values())
        return max([seed["since"], *there[: self.quorum]]) if len(there) >= self.quorum else None

    def leave_decided(self):
        left: list[Outcome] = []
        while (seeds := self.all()) and all(self.is_decided(index, seeds[0]) for index in self.optional):
            left += self.leave() if seeds[0] in self.sets() else self.give_up(DropReason.TOO_FAR)
        return left

    def give_up(self, reason):
        return [Drop(message, reason) for message in self.waiting.pop(0)["messages"] if message is not None]

    def leave(self):
        if not self.sets():
            return self.give_up(DropReason.OVERFLOW)
        seed = self.sets()[0]
        drops = []
        while self.waiting and self.all()[0] != seed:
            drops += self.give_up(DropReason.SUPERSEDED)
        messages, taken = list(seed["messages"]), self.taken(seed)
        for index in self.optional:
            best = taken.get(index)
            reason = DropReason.TOO_FAR if best is None else DropReason.SUPERSEDED
            drops += [self.drop(each, reason) for each in self.useless(index, seed, best)]
            if best is not None:
                self.queued.remove(best)
                messages[index] = best[1]
        if self.is_any:
            members = {index: stamp for index, (stamp, _) in taken.items()}
            self.last = seed["stamps"][0], members
        else:
            del self.waiting[0]
        return [*drops, Match(tuple(messages))]

    def drop_alone(self):
        return []

    def drop(self, each, reason):
        self.queued.remove(each)
        return Drop(each[1], reason)

    def empty(self, reason):
        held = [message for waiting in self.waiting for message in waiting["messages"] if message is not None]
        drops = [Drop(message, reason) for message in held + [message for _, message in self.queued]]
        self.waiting, self.queued, self.shown, self.came = [], [], {}, {}
        return drops


class ByStamp(Stage):
    """Each set takes the message nearest to its middle that is near all others, unless it is nearer to the next set.

    Near are two that are no farther apart than both may be off: half of slop, or less where the tolerance is less.
    """

    def __init__(self, optional, n_inputs, queue_size, slop, *, steps, tolerances):
        super().__init__(optional, n_inputs, queue_size)
        self.slop, self.steps = slop, steps
        self.twice_off = [slop if each is None else min(2 * each, slop) for each in tolerances]

    def room(self, one, other):
        """How much later the first of two could be and still be near the other, in half nanoseconds."""
        return self.twice_off[one[1]] + self.twice_off[other[1]] - 2 * (one[0] - other[0])

    def is_same(self, one, other):
        return one[0] == other[0]

    def in_order(self, queued):
        return sorted(queued, key=lambda each: each[0])

    def all(self):
        return self.around_any() if self.is_any else super().all()

    def around_any(self):
        """Wherever messages of enough inputs are near the oldest of them: round the first input's that is near."""
        rest, seeds = self.in_order(self.queued), []
        while rest:
            seed = self.soonest_over(rest)
            near = {each[1].input for each in rest if self.is_in_time(each, seed)}
            if len(near) < self.quorum:
                rest.remove(seed)
                continue
            first = [next((each for each in rest if each[1].input == index), None) for index in self.optional]
            for each in reversed(first[: seed[1].input]):
                if each is not None and self.is_in_time(each, seed):
                    seed = each
            rest.remove(seed)
            following = [stamp for stamp, message in rest if message.input == seed[1].input]
            there = [(seed[0], seed[1].input)]
            around = {
                "messages": [None] * self.n_inputs, "stamps": [seed[0]], "there": there, "since": -START_OF_TIME
            }  # fmt: skip
            made = {**around, "next": {"stamps": following[:1]} if following else None}
            seeds += [made] if self.since(made) is not None and not self.was_left_out(made) else []
        return seeds

    def soonest_over(self, queued):
        """The message to which the fewest later ones can be near."""
        return min(self.in_order(queued), key=lambda each: 2 * each[0] + self.twice_off[each[1].input])

    def is_in_time(self, each, other):
        """Whether a message is near another, or before it."""
        return self.room((each[0], each[1].input), (other[0], other[1].input)) >= 0

    def was_left_out(self, made):
        """Whether it is made only of what the last set would have taken, had it come in time."""
        if self.last is None:
            return False
        _, members = self.last
        return all(
            index not in members and all(self.room((stamp, index), (was, other)) >= 0 for other, was in members.items())
            for index, (stamp, _) in self.taken(made).items()
        )

    def drop_alone(self):
        left: list[Outcome] = []
        while self.is_any and self.queued:
            oldest = self.soonest_over(self.queued)
            may_be_near = [
                index
                for index in self.optional
                if index not in self.shown
                or self.room((self.shown[index] + max(1, self.steps[index]), index), (oldest[0], oldest[1].input)) >= 0
                or any(self.is_in_time(each, oldest) for each in self.of(index))
            ]
            if len(may_be_near) >= self.quorum:
                break
            left.append(self.drop(oldest, DropReason.TOO_FAR))
        return left

    def middle(self, seed):
        """Twice the middle."""
        return min(seed["stamps"]) + max(seed["stamps"])

    def fits(self, one, seed, there):
        stamp, _ = one
        near = all(self.room(one, other) >= 0 and self.room(other, one) >= 0 for other in there)
        following = seed["next"]
        return near and (following is None or 2 * stamp - self.middle(seed) <= self.middle(following) - 2 * stamp)

    def best(self, index, seed, there):
        fitting = [each for each in self.of(index) if self.fits((each[0], index), seed, there)]
        return min(fitting, key=lambda each: (abs(2 * each[0] - self.middle(seed)), each[0]), default=None)

    def useless(self, index, seed, best):
        if best is not None or self.is_any:
            last = best[0] if best is not None else seed["stamps"][0] + 1
            return [each for each in self.in_order(self.of(index)) if each[0] < last]
        return [
            each
            for each in self.in_order(self.of(index))
            if any(self.room(other, (each[0], index)) <= 0 for other in seed["there"])
        ]

    def is_decided(self, index, seed):
        """Whether a message of the least stamp that may come is farther from the middle than the best, or too far."""
        if index not in self.shown:
            return False
        soonest = self.shown[index] + max(1, self.steps[index])
        there, middle = seed["there"], self.middle(seed)
        best = self.best(index, seed, there)
        if best is not None:
            return abs(2 * soonest - middle) >= abs(2 * best[0] - middle) and 2 * soonest >= middle
        one = (soonest, index)
        return all(self.room(other, one) > 0 for other in there) and not self.fits(one, seed, there)


class ByKey(Stage):
    """Each set takes the message of its key."""

    def is_same(self, one, other):
        return one[1].key == other[1].key

    def in_order(self, queued):
        return queued

    def best(self, index, seed, _):
        return next((each for each in self.of(index) if each[1].key == seed["key"]), None)

    def useless(self, index, _, best):
        queued = self.of(index)
        if best is None:
            return []
        place = queued.index(best)
        return [each for number, each in enumerate(queued) if number < place or each[1].stamp < best[1].stamp]

    def is_decided(self, index, _):
        return any(each[1].key == waiting["key"] for each in self.of(index) for waiting in self.waiting)
