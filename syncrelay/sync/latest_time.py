"""latest_time: a set for each message of one input, with the latest message of every other."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from operator import ge
from typing import NamedTuple

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Queued


def check_max_ages(max_ages_ns: Sequence[int | None] | None, n_inputs: int) -> tuple[int | None, ...]:
    """Return the largest age of each input's messages, None for any; raises ValueError for a negative age."""
    ages = (None,) * n_inputs if max_ages_ns is None else tuple(max_ages_ns)
    if len(ages) != n_inputs or any(age is not None and age < 0 for age in ages):
        raise ValueError(f"max_ages_ns {ages} must be {n_inputs} numbers, 0 or more, or None")
    return ages


class _Lookup(NamedTuple):
    """The message that an input has for a trigger, as its place in the queue, and whether one may still come."""

    position: int | None
    may_come: bool


class LatestTime(Queued):
    """At each message of input `trigger`, a set of it and the latest not newer message of every other input.

    None is older at the trigger's stamp than its input's of `max_ages_ns` (None: any age will do). A message may
    serve many sets. A trigger waits for required inputs that have nothing for it yet, and is too far once one of them
    has shown newer messages only; so it does where fewer than `quorum` inputs have a message for it. It never waits for
    more of them. `release_oldest` lets the oldest waiting trigger expire.

        lidar |..a..b.c...d
        odom  |.A.B......D.
        -> a: aA
        -> b: bB
        -> c: cB
        -> d: dD

    The lidar is the trigger. B serves b and c.

    A message is superseded when a newer one serves in its place and it never did; expired when it is too old
    for any trigger to come.
    """

    __slots__ = (
        "_losses",
        "_max_ages",
        "_queue_size",
        "_queues",
        "_quorum",
        "_required",
        "_trigger",
        "n_inputs",
        "waits_ended",
        "waits_started",
    )

    repeats = True

    def __init__(
        self,
        *,
        n_inputs: int,
        queue_size: int,
        trigger: int,
        max_ages_ns: Sequence[int | None] | None = None,
        required: Sequence[bool] | None = None,
        quorum: int = 0,
    ) -> None:
        self.make_queues(n_inputs, queue_size)
        needed = (True,) * n_inputs if required is None else tuple(required)
        if not 0 <= trigger < n_inputs or len(needed) != n_inputs or not needed[trigger]:
            raise ValueError(f"trigger {trigger} must be a required input of {n_inputs}: {needed}")
        self._trigger = trigger
        self._max_ages = check_max_ages(max_ages_ns, n_inputs)
        self._required = needed
        self._quorum = quorum
        self.waits_started = 0
        self.waits_ended = 0

    def for_required(self, required: Sequence[bool], quorum: int) -> tuple["LatestTime", OptionalInputs]:
        policy = LatestTime(
            n_inputs=self.n_inputs,
            queue_size=self._queue_size,
            trigger=self._trigger,
            max_ages_ns=self._max_ages,
            required=required,
            quorum=quorum,
        )
        return policy, OptionalInputs(required=(True,) * self.n_inputs, quorum=0, queue_size=1, slop_ns=0)

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        queue = self._queues[place]
        if queue.is_served and stamp <= queue.stamps[0]:
            return (Drop(message, DropReason.LATE),)
        outcomes: list[Outcome] = []
        replaced = queue.insert(stamp, message)
        if replaced is not None:
            outcomes.append(Drop(replaced, DropReason.DUPLICATE))
        elif place == self._trigger:
            self.waits_started += 1
        self._serve(outcomes)
        if len(queue.stamps) > self._queue_size:
            self._losses.lose(place, queue.stamps[0])
            if place == self._trigger:
                self.waits_ended += 1
            outcomes += queue.drop(1, DropReason.OVERFLOW)
        return outcomes

    def release_oldest(self) -> Sequence[Outcome]:
        outcomes: list[Outcome] = [*self._drop_trigger(DropReason.EXPIRED)]
        self._serve(outcomes)
        return outcomes

    def flush(self, reason: DropReason) -> list[Drop]:
        self.waits_ended = self.waits_started
        return super().flush(reason)

    def let_go(self, reason: DropReason) -> list[Drop]:
        """Drop the triggers that wait, and all but the latest message of every other input."""
        drops = []
        for place, queue in enumerate(self._queues):
            kept = int(place != self._trigger)
            drops += queue.drop(max(0, len(queue.stamps) - kept), reason)
        self.waits_ended = self.waits_started
        return drops

    def _serve(self, outcomes: list[Outcome]) -> None:
        triggers = self._queues[self._trigger]
        while triggers.stamps:
            stamp = triggers.stamps[0]
            found = [self._look_up(place, stamp) for place in range(self.n_inputs)]
            if self._are_enough([near.position is not None for near in found]):
                self._emit([near.position for near in found], stamp, outcomes)
            elif self._are_enough([near.may_come for near in found]):
                return
            else:
                self._note_missed(stamp)
                outcomes += self._drop_trigger(DropReason.TOO_FAR)

    def _are_enough(self, there: Sequence[bool]) -> bool:
        """Whether a set may leave with the inputs that are there."""
        return sum(there) >= self._quorum and all(map(ge, there, self._required))

    def _look_up(self, place: int, stamp: int) -> _Lookup:
        stamps, max_age = self._queues[place].stamps, self._max_ages[place]
        position = bisect_right(stamps, stamp) - 1
        if position >= 0 and (max_age is None or stamp - stamps[position] <= max_age):
            return _Lookup(position, may_come=True)
        return _Lookup(None, may_come=position == len(stamps) - 1)

    def _note_missed(self, stamp: int) -> None:
        for place, queue in enumerate(self._queues):
            if queue.stamps and queue.stamps[0] > stamp:
                max_age = self._max_ages[place]
                self._losses.miss(place, queue.stamps, stamp, before=stamp if max_age is None else max_age, after=0)

    def _emit(self, positions: Sequence[int | None], stamp: int, outcomes: list[Outcome]) -> None:
        members: list[Message | None] = []
        for place, position in enumerate(positions):
            if position is None:
                outcomes += self._drop_expired(place, stamp)
                members.append(None)
                continue
            queue = self._queues[place]
            outcomes += queue.drop(position, DropReason.SUPERSEDED)
            members.append(queue.messages[0])
            queue.is_served = True
        outcomes.append(Match(tuple(members)))
        self._queues[self._trigger].take(1)
        self._queues[self._trigger].is_served = False
        self.waits_ended += 1

    def _drop_trigger(self, reason: DropReason) -> list[Drop]:
        stamp = self._queues[self._trigger].stamps[0]
        drops = self._queues[self._trigger].drop(1, reason)
        self.waits_ended += 1
        for place in range(self.n_inputs):
            drops += self._drop_expired(place, stamp)
        return drops

    def _drop_expired(self, place: int, stamp: int) -> list[Drop]:
        """Drop what is too old for a trigger of this stamp, and so for all that follow."""
        max_age = self._max_ages[place]
        if max_age is None:
            return []
        count = bisect_left(self._queues[place].stamps, stamp - max_age)
        return self._queues[place].drop(count, DropReason.EXPIRED)
