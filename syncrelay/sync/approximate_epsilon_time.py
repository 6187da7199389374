"""approximate_epsilon_time: the oldest messages are a set if they are within epsilon; if not, they are dropped."""

from collections.abc import Sequence

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Queued, limit_of
from syncrelay.sync.windows import Tolerances, tolerances_of, windows_of


class ApproximateEpsilonTime(Queued):
    """The oldest messages of all inputs are a set, at once, if none is more than epsilon after the oldest.

    If one is, the oldest message of every input that has one within epsilon of the oldest of all is too far. Where
    inputs have `tolerances_ns`, within epsilon are those whose windows begin before the first one ends. This is
    C++ message_filters' ApproximateEpsilonTime, except that queues are in stamp order, and that a message whose
    stamp is still queued replaces the queued one.

        lidar  |ab....c
        camera |..B...C
        -> B: a too_far, bB
        -> C: cC

    Epsilon is 1: a is the oldest, and B lies 2 after it.
    """

    __slots__ = ("_epsilon", "_losses", "_queue_size", "_queues", "_tolerances", "_windows", "n_inputs")

    def __init__(
        self, *, n_inputs: int, queue_size: int, epsilon_ns: int | None, tolerances_ns: Tolerances = None
    ) -> None:
        self.make_queues(n_inputs, queue_size)
        self._epsilon = limit_of(epsilon_ns, "epsilon_ns")
        self._tolerances = tolerances_ns
        self._windows = windows_of(self._epsilon, tolerances_ns, n_inputs)

    def for_required(self, required: Sequence[bool], quorum: int) -> tuple["ApproximateEpsilonTime", OptionalInputs]:
        size, epsilon = self._queue_size, self._epsilon
        policy = ApproximateEpsilonTime(
            n_inputs=sum(required),
            queue_size=size,
            epsilon_ns=epsilon,
            tolerances_ns=tolerances_of(self._tolerances, required),
        )
        stage = OptionalInputs(
            required=required, quorum=quorum, queue_size=size, slop_ns=epsilon, tolerances_ns=self._tolerances
        )
        return policy, stage

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
        both = list(zip(self._queues, self._windows, strict=True))
        first, own = min(both, key=lambda each: each[0].stamps[0] + each[1].after)
        oldest = first.stamps[0]
        near = [queue for queue, window in both if queue.stamps[0] - window.before <= oldest + own.after]
        taken = [queue.take(1)[0] for queue in near]
        if len(taken) == self.n_inputs:
            outcomes.append(Match(tuple(taken)))
            return
        outcomes += [Drop(message, DropReason.TOO_FAR) for message in taken]
        if all(queue.stamps for queue in near):
            return
        for place, (queue, window) in enumerate(both):
            if queue not in near:
                before, after = own.before + window.after, own.after + window.before
                self._losses.miss(place, queue.stamps, oldest, before=before, after=after)
