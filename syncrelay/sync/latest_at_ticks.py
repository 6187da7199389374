"""latest_time with a clock as trigger: at each tick, the latest of every input."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from syncrelay.sync.latest_time import check_max_ages
from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Policy, check_sizes
from syncrelay.sync.queues import LONGEST_QUEUE, StampQueue
from syncrelay.sync.ticks import Ticks

REST_NS = 10_000_000_000
"""After so long in which no message came, ticks pass without sets until one comes."""

# A clock that falls by more starts again; one that falls by less was corrected, and no tick comes twice.
_FALL_NS = 1_000_000_000


class LatestAtTicks(Policy):
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

    A tick leaves when `advance` reaches it, with what was fed by then; whoever calls that decides how long messages
    may be on their way. What came in time decides alone: calling `advance` more often changes nothing, and a recording
    gives the sets that were given live. A tick at which a required input has nothing young enough gives no set, and
    none is made up for later.

    Ticks rest when nothing has come on any input for REST_NS: sensors that died don't give sets for ever, and a
    machine that was suspended does not give those of the night all at once when it wakes. No work is done for a tick
    that gives no set.

    A message is superseded when a newer one serves every tick to come in its place and it never did; expired when it
    is too old for any tick to come.
    """

    __slots__ = (
        "_fed_until",
        "_max_ages",
        "_needed",
        "_passed",
        "_queue_size",
        "_queues",
        "_required",
        "_served",
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
    ) -> None:
        check_sizes(n_inputs, queue_size)
        needed = (True,) * n_inputs if required is None else tuple(required)
        if len(needed) != n_inputs or not any(needed):
            raise ValueError(f"required {needed} must be {n_inputs}, one required")
        self.n_inputs = n_inputs
        self.ticks = ticks
        self._queue_size = queue_size
        self._max_ages = check_max_ages(max_ages_ns, n_inputs)
        self._required = needed
        self._queues = [StampQueue() for _ in needed]
        self._served = [False] * n_inputs
        self._needed: list[int | None] = [None] * n_inputs
        # The last tick that has passed, the time reached, and that at which the last message was fed.
        self._passed = -1
        self._until = 0
        self._fed_until = -REST_NS

    def for_required(self, required: Sequence[bool]) -> tuple["LatestAtTicks", OptionalInputs]:
        policy = LatestAtTicks(
            n_inputs=self.n_inputs,
            queue_size=self._queue_size,
            ticks=self.ticks,
            max_ages_ns=self._max_ages,
            required=required,
        )
        return policy, OptionalInputs(required=(True,) * self.n_inputs, queue_size=1, slop_ns=0)

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        queue = self._queues[place]
        self._fed_until = self._until
        if self._served[place] and stamp <= queue.stamps[0]:
            return (Drop(message, DropReason.LATE),)
        replaced = queue.insert(stamp, message)
        outcomes: list[Outcome] = [] if replaced is None else [Drop(replaced, DropReason.DUPLICATE)]
        outcomes += self._drop_useless(place, stamp)
        if len(queue.stamps) > self._queue_size:
            self._note_needed(place)
            outcomes += self._drop_oldest(place, 1, DropReason.OVERFLOW)
        return outcomes

    def advance(self, until: int) -> Sequence[Outcome]:
        self._begin_again_if_fallen(until)
        outcomes: list[Outcome] = []
        passed = self.ticks.last_until(until)
        while (tick := self._next_possible()) is not None and tick <= passed:
            self._passed = tick
            self._emit(self.ticks.at(tick), outcomes)
        self._passed = max(self._passed, passed)
        return outcomes

    def next_tick(self) -> int | None:
        tick = self._next_possible()
        return None if tick is None else self.ticks.at(tick)

    def pass_over(self, until: int) -> None:
        self._begin_again_if_fallen(until)
        self._passed = max(self._passed, self.ticks.last_until(until))

    def flush(self, reason: DropReason) -> list[Drop]:
        # The ticks that have passed have passed.
        drops = []
        for place, queue in enumerate(self._queues):
            drops += self._drop_oldest(place, len(queue.stamps), reason)
        return drops

    def let_go(self, reason: DropReason) -> list[Drop]:
        """Drop all but the latest message of every input."""
        drops = []
        for place, queue in enumerate(self._queues):
            drops += self._drop_oldest(place, max(0, len(queue.stamps) - 1), reason)
        return drops

    def buffered(self, place: int) -> int:
        return len(self._queues[place].stamps) - self._served[place]

    def needed_queue(self, place: int) -> int | None:
        return self._needed[place]

    def _begin_again_if_fallen(self, until: int) -> None:
        if until < self.ticks.at(self._passed) - _FALL_NS:
            self._passed = self.ticks.last_until(until)
            self._fed_until = min(self._fed_until, until)
        self._until = until

    def _next_possible(self) -> int | None:
        """Give the first tick after those that have passed at which every required input has a message."""
        tick = self._passed + 1
        last = self.ticks.last_until(self._fed_until + REST_NS)
        while tick <= last:
            needed = tick
            for place, is_needed in enumerate(self._required):
                if is_needed:
                    served = self._first_served(place, tick)
                    if served is None:
                        return None
                    needed = max(needed, served)
            if needed == tick:
                return tick
            tick = needed
        return None

    def _first_served(self, place: int, tick: int) -> int | None:
        """Give this tick if one of an input's messages serves it, else the first later one not before the next."""
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
                outcomes += self._drop_oldest(place, position, DropReason.SUPERSEDED)
                members.append(queue.messages[0])
                self._served[place] = True
            else:
                outcomes += self._drop_oldest(place, position + 1, DropReason.EXPIRED)
                members.append(None)
        outcomes.append(Match(tuple(members), tick=time))

    def _drop_useless(self, place: int, stamp: int) -> list[Drop]:
        """Drop what no tick to come can need now that a message of this stamp is there, be it that one.

        Of the messages between two ticks only the last is: a queue holds as many as there are ticks in its time.
        """
        queue, next_time = self._queues[place], self.ticks.at(self._passed + 1)
        max_age = self._max_ages[place]
        drops = []
        if max_age is not None:
            expired = bisect_left(queue.stamps, next_time - max_age)
            drops = self._drop_oldest(place, expired, DropReason.EXPIRED)
        if stamp <= next_time:
            superseded = bisect_right(queue.stamps, next_time) - 1
            return [*drops, *self._drop_oldest(place, superseded, DropReason.SUPERSEDED)]
        tick, position = self.ticks.first_from(stamp), bisect_left(queue.stamps, stamp)
        if position + 1 < len(queue.stamps) and queue.stamps[position + 1] <= self.ticks.at(tick):
            return [*drops, Drop(queue.remove(position), DropReason.SUPERSEDED)]
        if position > 0 and queue.stamps[position - 1] > self.ticks.at(tick - 1):
            return [*drops, Drop(queue.remove(position - 1), DropReason.SUPERSEDED)]
        return drops

    def _note_needed(self, place: int) -> None:
        """See that a queue is full, which one is not that has room for a message of every tick that is waited for."""
        newest = self._queues[place].stamps[-1]
        length = self.ticks.first_from(newest) - self._passed + 1
        if (self._needed[place] or 0) < length <= LONGEST_QUEUE:
            self._needed[place] = length

    def _drop_oldest(self, place: int, count: int, reason: DropReason) -> list[Drop]:
        """Remove the oldest; the first may have served in a set, and then leaves matched."""
        taken = self._queues[place].take(count)
        if taken and self._served[place]:
            self._served[place] = False
            del taken[0]
        return [Drop(message, reason) for message in taken]
