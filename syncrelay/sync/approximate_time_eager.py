"""approximate_time_eager: the first match, without waiting for a better one."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Queued, limit_of


class ApproximateTimeEager(Queued):
    """The tightest set within slop that has the message that has just arrived leaves at once.

    Of sets of the same span, the one that starts first leaves, in which each input has its latest message that is not
    newer than the arrived one. Messages older than a set that leaves are superseded, so sets never go back. A message
    that is more than slop older than all messages of another input is too far. This is for users of Python's
    ApproximateTimeSynchronizer, whose slop is exclusive, which takes the first set that fits, and whose cost is a
    product of queues.

        lidar  |a..b..cd
        camera |..A....D
        -> A: aA
        -> D: b too_far, c superseded, dD

    Slop is 2. aA does not wait for b, which is nearer to A and comes a little later.
    """

    __slots__ = ("_losses", "_queue_size", "_queues", "_slop", "_stamps", "n_inputs")

    def __init__(self, *, n_inputs: int, queue_size: int, slop_ns: int | None) -> None:
        self.make_queues(n_inputs, queue_size)
        self._slop = limit_of(slop_ns)
        self._stamps = [queue.stamps for queue in self._queues]

    def for_required(self, required: Sequence[bool], quorum: int) -> tuple["ApproximateTimeEager", OptionalInputs]:
        size, slop = self._queue_size, self._slop
        stage = OptionalInputs(required=required, quorum=quorum, queue_size=size, slop_ns=slop)
        return ApproximateTimeEager(n_inputs=sum(required), queue_size=size, slop_ns=slop), stage

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        queue, stamps = self._queues[place], self._stamps[place]
        outcomes: list[Outcome] = []
        if not stamps or stamp > stamps[-1]:
            stamps.append(stamp)
            queue.messages.append(message)
            if len(stamps) == 1:
                self._begin(stamp, outcomes)
        elif (replaced := queue.insert(stamp, message)) is not None:
            outcomes.append(Drop(replaced, DropReason.DUPLICATE))
        elif stamps[0] == stamp:
            self._drop_too_far(outcomes)
        if all(self._stamps):
            # There was no set before, so this is the only message of its input. The first messages of all inputs are
            # within slop of the latest of them, so there is a set now.
            self._match(stamp, outcomes)
        if len(stamps) > self._queue_size:
            self._losses.lose(place, stamps[0])
            outcomes += queue.drop(1, DropReason.OVERFLOW)
            self._drop_too_far(outcomes)
        return outcomes

    def _begin(self, stamp: int, outcomes: list[Outcome]) -> None:
        """Note which overflowed messages the only message of its input has missed, and drop what is too far."""
        for place, stamps in enumerate(self._stamps):
            if stamps and stamps[0] > stamp + self._slop:
                self._losses.miss(place, stamps, stamp, before=self._slop, after=self._slop)
        self._drop_too_far(outcomes)

    def _drop_too_far(self, outcomes: list[Outcome]) -> None:
        """Drop messages that are not within slop of any message that another input has or will send."""
        while (firsts := [stamps[0] for stamps in self._stamps if stamps]) and min(firsts) < max(firsts) - self._slop:
            near = max(firsts) - self._slop
            for queue in self._queues:
                outcomes += queue.drop(bisect_left(queue.stamps, near), DropReason.TOO_FAR)

    def _match(self, stamp: int, outcomes: list[Outcome]) -> None:
        if max(map(len, self._stamps)) == 1:
            # The usual case: there is no choice, and nothing is left over.
            outcomes.append(Match(tuple([queue.messages.pop() for queue in self._queues])))
            for stamps in self._stamps:
                stamps.clear()
            return
        members = []
        for queue, wanted in zip(self._queues, _tightest(stamp, self._stamps), strict=True):
            if queue.stamps[0] != wanted:
                outcomes += queue.drop(bisect_left(queue.stamps, wanted), DropReason.SUPERSEDED)
            members.append(queue.remove(0))
        outcomes.append(Match(tuple(members)))
        self._drop_too_far(outcomes)


def _tightest(stamp: int, queues: Sequence[Sequence[int]]) -> list[int]:
    """Return the stamps of the tightest set with `stamp`, one for each input; of equal spans, the first.

    Of each input only its last stamp up to `stamp` or its first one after it can be in the tightest set. The search
    begins with the last stamps up to `stamp`. It replaces the earliest one by the next of its input, again and again,
    until an input has no next one, as the input of `stamp` has none.
    """
    after = [bisect_right(stamps, stamp) for stamps in queues]
    best = [stamps[max(position - 1, 0)] for stamps, position in zip(queues, after, strict=True)]
    candidate = best.copy()
    earliest = iter(sorted(range(len(queues)), key=best.__getitem__))
    while after[place := next(earliest)] < len(queues[place]):
        candidate[place] = queues[place][after[place]]
        if max(candidate) - min(candidate) < max(best) - min(best):
            best = candidate.copy()
    return best
