"""approximate_time_eager: the soonest match, with no wait for a better one."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Policy, check_sizes
from syncrelay.sync.queues import Losses


class ApproximateTimeEager(Policy):
    """The tightest set within slop that holds the message just arrived leaves at once.

    Of sets of one span, the one that starts first, each input in it with its latest message that is not newer
    than the one just arrived. What is older than a set that leaves is superseded, so sets never go
    back; what lies further than slop before all messages of another input is too far. Meant for what Python's
    ApproximateTimeSynchronizer is used for, whose slop is exclusive, whose fit is the first one found, and
    whose cost is a product of queues.

        lidar  |a..b..cd
        camera |..A....D
        -> A: aA
        -> D: b too_far, c superseded, dD

    Slop is 2. aA does not wait for b, which is nearer to A and comes a little later.
    """

    __slots__ = ("_losses", "_messages", "_queue_size", "_slop", "_stamps", "n_inputs")

    def __init__(self, *, n_inputs: int, queue_size: int, slop_ns: int) -> None:
        check_sizes(n_inputs, queue_size)
        if slop_ns < 0:
            raise ValueError(f"slop_ns {slop_ns} must be 0 or more")
        self.n_inputs = n_inputs
        self._queue_size = queue_size
        self._slop = slop_ns
        self._stamps: list[list[int]] = [[] for _ in range(n_inputs)]
        self._messages: list[list[Message]] = [[] for _ in range(n_inputs)]
        self._losses = Losses(n_inputs)

    def narrowed(self, required: Sequence[bool]) -> tuple["ApproximateTimeEager", OptionalInputs]:
        size, slop = self._queue_size, self._slop
        stage = OptionalInputs(required=required, queue_size=size, slop_ns=slop)
        return ApproximateTimeEager(n_inputs=sum(required), queue_size=size, slop_ns=slop), stage

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        stamps = self._stamps[place]
        outcomes: list[Outcome] = []
        if not stamps or stamp > stamps[-1]:
            stamps.append(stamp)
            self._messages[place].append(message)
            if len(stamps) == 1:
                self._begin(stamp, outcomes)
        else:
            self._insert(place, stamp, message, outcomes)
        if all(self._stamps):
            # No set was in here before, so this is the first message of its input; all first messages lie
            # within slop of the latest of them, so there is a set now.
            self._match(stamp, outcomes)
        if len(stamps) > self._queue_size:
            self._losses.lose(place, stamps[0])
            self._drop_oldest(place, 1, DropReason.OVERFLOW, outcomes)
            self._drop_too_far(outcomes)
        return outcomes

    def flush(self, reason: DropReason) -> list[Drop]:
        drops = [Drop(message, reason) for messages in self._messages for message in messages]
        for stamps, messages in zip(self._stamps, self._messages, strict=True):
            stamps.clear()
            messages.clear()
        self._losses.forget()
        return drops

    def buffered(self, place: int) -> int:
        return len(self._stamps[place])

    def needed_queue(self, place: int) -> int | None:
        return self._losses.needed[place]

    def _insert(self, place: int, stamp: int, message: Message, outcomes: list[Outcome]) -> None:
        """Put in place what is not newer than its whole queue, which is not empty."""
        stamps = self._stamps[place]
        messages = self._messages[place]
        position = bisect_left(stamps, stamp)
        if stamps[position] == stamp:
            outcomes.append(Drop(messages[position], DropReason.DUPLICATE))
            messages[position] = message
            return
        stamps.insert(position, stamp)
        messages.insert(position, message)
        if position == 0:
            self._drop_too_far(outcomes)

    def _begin(self, stamp: int, outcomes: list[Outcome]) -> None:
        """Note what the only message of its input has missed, and drop what is too far."""
        # The first messages of the other inputs lie within slop of each other.
        far = [stamps for stamps in self._stamps if stamps and abs(stamps[0] - stamp) > self._slop]
        if not far:
            return
        for place, stamps in enumerate(self._stamps):
            if stamps and stamps[0] > stamp + self._slop:
                self._losses.miss(place, stamps, stamp, before=self._slop, after=self._slop)
        self._drop_too_far(outcomes)

    def _drop_too_far(self, outcomes: list[Outcome]) -> None:
        """Drop what no message that any other input still has, or will show, lies within slop of."""
        while (firsts := [stamps[0] for stamps in self._stamps if stamps]) and min(firsts) < max(firsts) - self._slop:
            near = max(firsts) - self._slop
            for place, stamps in enumerate(self._stamps):
                if stamps and stamps[0] < near:
                    self._drop_oldest(place, bisect_left(stamps, near), DropReason.TOO_FAR, outcomes)

    def _drop_oldest(self, place: int, count: int, reason: DropReason, outcomes: list[Outcome]) -> None:
        messages = self._messages[place]
        outcomes += [Drop(message, reason) for message in messages[:count]]
        del messages[:count]
        del self._stamps[place][:count]

    def _match(self, stamp: int, outcomes: list[Outcome]) -> None:
        if max(map(len, self._stamps)) == 1:
            # No choice and nothing left over, as it is most of the time.
            outcomes.append(Match(tuple([messages.pop() for messages in self._messages])))
            for stamps in self._stamps:
                stamps.clear()
            return
        members = []
        for place, wanted in enumerate(_tightest(stamp, self._stamps)):
            stamps = self._stamps[place]
            if stamps[0] != wanted:
                self._drop_oldest(place, bisect_left(stamps, wanted), DropReason.SUPERSEDED, outcomes)
            del stamps[0]
            members.append(self._messages[place].pop(0))
        outcomes.append(Match(tuple(members)))
        self._drop_too_far(outcomes)


def _tightest(stamp: int, queues: Sequence[Sequence[int]]) -> list[int]:
    """Choose a stamp per input around the only one of its input: the least span, of equal spans the first.

    From each input only its last stamp up to `stamp` or its first after it can be in the tightest set. Starting
    from those up to it, the earliest is given up for the one after, again and again, until an input has none:
    that of `stamp` has none.
    """
    after = [bisect_right(stamps, stamp) for stamps in queues]
    best = [stamps[max(position - 1, 0)] for stamps, position in zip(queues, after, strict=True)]
    given_up = best.copy()
    earliest = iter(sorted(range(len(queues)), key=best.__getitem__))
    while after[place := next(earliest)] < len(queues[place]):
        given_up[place] = queues[place][after[place]]
        if max(given_up) - min(given_up) < max(best) - min(best):
            best = given_up.copy()
    return best
