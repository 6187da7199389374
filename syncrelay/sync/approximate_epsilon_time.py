"""approximate_epsilon_time: the oldest messages are a set if they are within epsilon; if not, they are dropped."""

from collections.abc import Sequence

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Queued, limit_of


class ApproximateEpsilonTime(Queued):
    """The oldest messages of all inputs are a set, at once, if none is more than epsilon after the oldest.

    If one is, the oldest message of every input that has one within epsilon of the oldest of all is too far. This is
    C++ message_filters' ApproximateEpsilonTime, except that queues are in stamp order, and that a message whose
    stamp is still queued replaces the queued one.

        lidar  |ab....c
        camera |..B...C
        -> B: a too_far, bB
        -> C: cC

    Epsilon is 1: a is the oldest, and B lies 2 after it.
    """

    __slots__ = ("_epsilon", "_losses", "_queue_size", "_queues", "n_inputs")

    def __init__(self, *, n_inputs: int, queue_size: int, epsilon_ns: int | None) -> None:
        self.make_queues(n_inputs, queue_size)
        self._epsilon = limit_of(epsilon_ns, "epsilon_ns")

    def for_required(self, required: Sequence[bool], quorum: int) -> tuple["ApproximateEpsilonTime", OptionalInputs]:
        size, epsilon = self._queue_size, self._epsilon
        stage = OptionalInputs(required=required, quorum=quorum, queue_size=size, slop_ns=epsilon)
        return ApproximateEpsilonTime(n_inputs=sum(required), queue_size=size, epsilon_ns=epsilon), stage

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        queue = self._queues[place]
        replaced = queue.insert(stamp, message)
        if replaced is not None:
            return (Drop(replaced, DropReason.DUPLICATE),)
        outcomes: list[Outcome] = []
        while all(queue.stamps for queue in self._queues):
            self._take_oldest(outcomes)
        if len(queue.stamps) > self._queue_size:
            self._losses.lose(place, queue.stamps[0])
            outcomes += queue.drop(1, DropReason.OVERFLOW)
        return outcomes

    def _take_oldest(self, outcomes: list[Outcome]) -> None:
        oldest = min(queue.stamps[0] for queue in self._queues)
        last = oldest + self._epsilon
        near = [queue for queue in self._queues if queue.stamps[0] <= last]
        taken = [queue.take(1)[0] for queue in near]
        if len(taken) == self.n_inputs:
            outcomes.append(Match(tuple(taken)))
            return
        outcomes += [Drop(message, DropReason.TOO_FAR) for message in taken]
        if all(queue.stamps for queue in near):
            return
        for place, queue in enumerate(self._queues):
            if queue not in near:
                self._losses.miss(place, queue.stamps, oldest, before=self._epsilon, after=self._epsilon)
