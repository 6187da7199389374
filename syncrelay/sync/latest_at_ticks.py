"""latest_time with a clock as trigger: at each tick, the latest of every input."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from syncrelay.sync.latest_time import check_max_ages
from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Queued
from syncrelay.sync.ticks import Ticks

REST_NS = 10_000_000_000
"""When no message has come for this long, ticks give no sets until one comes."""

# A clock that falls by more was reset. One that falls by less was corrected, and no tick comes twice.
_FALL_NS = 1_000_000_000


class LatestAtTicks(Queued):
    """At each tick, a set of every input's latest message that is not newer than the tick.

    None is older at the tick than its input's of `max_ages_ns` (None: any age will do). A message may serve many
    sets. Nothing is interpolated: a message is given as it came, or not at all.

        lidar |.a.b......c..d..
        odom  |..A....B........
        -> b: a superseded
        -> @5: bA
        -> @10: bB
        -> d: c superseded
        -> @15: dB

    Ticks are at columns 5, 10 and 15. c came when its tick had left.

    The set of a tick leaves when `advance` reaches the tick, with the messages that were fed by then. So the caller
    decides how long messages may be on their way. Calling `advance` more often changes nothing, and a recording gives
    the sets that were given live. A tick at which a required input has no message that is young enough gives no set,
    and the set is not made up for later.

    Ticks give no sets once no input has sent anything for REST_NS. So sensors that died do not give sets forever, and
    a machine that was suspended overnight does not give the sets of the night when it wakes. Ticks that give no set
    cost nothing.

    A message that has been in no set is superseded when a newer one is better for every tick to come, and expired when
    it is too old for every tick to come.
    """

    __slots__ = (
        "_fed_until",
        "_has_changed",
        "_losses",
        "_max_ages",
        "_passed",
        "_possible",
        "_queue_size",
        "_queues",
        "_quorum",
        "_required",
        "_until",
        "n_inputs",
        "ticks",
    )

    by_clock = True
    repeats = True

    def __init__(
        self,
        *,
        n_inputs: int,
        queue_size: int,
        ticks: Ticks,
        max_ages_ns: Sequence[int | None] | None = None,
        required: Sequence[bool] | None = None,
        quorum: int = 0,
    ) -> None:
        self.make_queues(n_inputs, queue_size)
        needed = (True,) * n_inputs if required is None else tuple(required)
        if len(needed) != n_inputs or not (any(needed) or 0 < quorum <= n_inputs):
            raise ValueError(f"required {needed} must be {n_inputs}, one required, or quorum {quorum} from 1")
        self.ticks = ticks
        self._max_ages = check_max_ages(max_ages_ns, n_inputs)
        self._required = needed
        self._quorum = quorum
        # The last tick that has passed, the time that was reached, and the time when the last message was fed.
        self._passed = -1
        self._until = 0
        self._fed_until = -REST_NS
        # The next possible tick, as long as nothing has changed: it is asked for at every turn of the loop.
        self._possible: int | None = None
        self._has_changed = True

    def for_required(self, required: Sequence[bool], quorum: int) -> tuple["LatestAtTicks", OptionalInputs]:
        policy = LatestAtTicks(
            n_inputs=self.n_inputs,
            queue_size=self._queue_size,
            ticks=self.ticks,
            max_ages_ns=self._max_ages,
            required=required,
            quorum=quorum,
        )
        return policy, OptionalInputs(required=(True,) * self.n_inputs, quorum=0, queue_size=1, slop_ns=0)

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        queue = self._queues[place]
        self._fed_until, self._has_changed = self._until, True
        replaced = queue.insert(stamp, message)
        outcomes: list[Outcome] = [] if replaced is None else [Drop(replaced, DropReason.DUPLICATE)]
        outcomes += self._drop_useless(place, stamp)
        if len(queue.stamps) > self._queue_size:
            # A queue with a place for every tick that is waited for would not be full.
            self._losses.need(place, self.ticks.first_from(queue.stamps[-1]) - self._passed + 1)
            outcomes += queue.drop(1, DropReason.OVERFLOW)
        return outcomes

    def advance(self, until: int) -> Sequence[Outcome]:
        self._begin_again_if_fallen(until)
        outcomes: list[Outcome] = []
        passed = self.ticks.last_until(until)
        if passed <= self._passed:
            return outcomes
        while (tick := self._next_possible()) is not None and tick <= passed:
            self._pass(tick)
            self._emit(self.ticks.at(tick), outcomes)
        self._pass(passed)
        return outcomes

    def next_tick(self) -> int | None:
        tick = self._next_possible()
        return None if tick is None else self.ticks.at(tick)

    def pass_over(self, until: int) -> None:
        self._begin_again_if_fallen(until)
        self._pass(max(self._passed, self.ticks.last_until(until)))

    def flush(self, reason: DropReason) -> list[Drop]:
        self._has_changed = True
        return super().flush(reason)

    def let_go(self, reason: DropReason) -> list[Drop]:
        """Drop all but the latest message of every input."""
        self._has_changed = True
        return [drop for queue in self._queues for drop in queue.drop(max(0, len(queue.stamps) - 1), reason)]

    def _begin_again_if_fallen(self, until: int) -> None:
        if until < self.ticks.at(self._passed) - _FALL_NS:
            self._pass(self.ticks.last_until(until))
            self._fed_until = min(self._fed_until, until)
        self._until = until

    def _pass(self, tick: int) -> None:
        self._passed, self._has_changed = tick, True

    def _next_possible(self) -> int | None:
        """Return the next tick at which every required input has a message, and as many inputs as are needed."""
        if self._has_changed:
            self._possible, self._has_changed = self._search(), False
        return self._possible

    def _search(self) -> int | None:
        tick = self._passed + 1
        last = self.ticks.last_until(self._fed_until + REST_NS)
        while tick <= last:
            served = [self._first_served(place, tick) for place in range(self.n_inputs)]
            enough = sorted(first for first in served if first is not None)[: self._quorum]
            needed = [first for first, is_needed in zip(served, self._required, strict=True) if is_needed]
            if None in needed or len(enough) < self._quorum:
                return None
            latest = max(filter(None, (*needed, *enough)), default=tick)
            if latest == tick:
                return tick
            tick = latest
        return None

    def _first_served(self, place: int, tick: int) -> int | None:
        """Return this tick if a message of the input serves it, else the first tick that the next message can serve."""
        stamps = self._queues[place].stamps
        position = bisect_right(stamps, self.ticks.at(tick))
        if self._is_young(place, position - 1, self.ticks.at(tick)):
            return tick
        return self.ticks.first_from(stamps[position]) if position < len(stamps) else None

    def _is_young(self, place: int, position: int, time: int) -> bool:
        max_age = self._max_ages[place]
        return position >= 0 and (max_age is None or time - self._queues[place].stamps[position] <= max_age)

    def _emit(self, time: int, outcomes: list[Outcome]) -> None:
        members: list[Message | None] = []
        for place, queue in enumerate(self._queues):
            position = bisect_right(queue.stamps, time) - 1
            if self._is_young(place, position, time):
                outcomes += queue.drop(position, DropReason.SUPERSEDED)
                members.append(queue.messages[0])
                queue.is_served = True
            else:
                outcomes += queue.drop(position + 1, DropReason.EXPIRED)
                members.append(None)
        outcomes.append(Match(tuple(members), tick=time))

    def _drop_useless(self, place: int, stamp: int) -> list[Drop]:
        """Drop what no tick to come can need now that a message of this stamp is there; it may be that one.

        Of the messages between two ticks only the last is needed, so a queue needs one place for each tick.
        """
        queue, next_time = self._queues[place], self.ticks.at(self._passed + 1)
        max_age = self._max_ages[place]
        drops: list[Drop] = []
        if max_age is not None:
            expired = bisect_left(queue.stamps, next_time - max_age)
            drops = queue.drop(expired, DropReason.EXPIRED)
        drops += queue.drop(max(0, bisect_right(queue.stamps, next_time) - 1), DropReason.SUPERSEDED)
        if stamp <= next_time:
            return drops
        tick, position = self.ticks.first_from(stamp), bisect_left(queue.stamps, stamp)
        if position + 1 < len(queue.stamps) and queue.stamps[position + 1] <= self.ticks.at(tick):
            return [*drops, Drop(queue.remove(position), DropReason.SUPERSEDED)]
        if position > 0 and queue.stamps[position - 1] > self.ticks.at(tick - 1):
            return [*drops, Drop(queue.remove(position - 1), DropReason.SUPERSEDED)]
        return drops
