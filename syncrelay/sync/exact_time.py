"""exact_time: messages of equal stamps are a set."""

from bisect import bisect_left, insort
from collections.abc import Sequence

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Policy, check_sizes
from syncrelay.sync.queues import Losses


class ExactTime(Policy):
    """Messages of equal stamps on all inputs are a set, and leave when the last of them is there.

    As in C++ message_filters' ExactTime, messages older than a set that leaves are superseded, and `queue_size` is the
    number of distinct stamps that are kept, over all inputs. Above it the oldest stamp overflows, even if it has just
    arrived.

        left  |ab.d
        right |..CD
        -> D: a superseded, b superseded, C superseded, dD
    """

    __slots__ = ("_losses", "_order", "_queue_size", "_sets", "n_inputs")

    def __init__(self, *, n_inputs: int, queue_size: int) -> None:
        check_sizes(n_inputs, queue_size)
        self.n_inputs = n_inputs
        self._queue_size = queue_size
        self._sets: dict[int, list[Message | None]] = {}
        self._order: list[int] = []
        self._losses = Losses(n_inputs)

    @property
    def at_once(self) -> int:
        return 0

    @property
    def is_new(self) -> bool:
        return not self._order

    def for_required(self, required: Sequence[bool], quorum: int) -> tuple["ExactTime", OptionalInputs]:
        stage = OptionalInputs(required=required, quorum=quorum, queue_size=self._queue_size, slop_ns=0)
        return ExactTime(n_inputs=sum(required), queue_size=self._queue_size), stage

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        messages = self._sets.get(stamp)
        if messages is None:
            return self._begin(place, stamp, message)
        replaced = messages[place]
        messages[place] = message
        if replaced is not None:
            return (Drop(replaced, DropReason.DUPLICATE),)
        if not all(messages):
            return ()
        return self._emit(stamp, messages)

    def flush(self, reason: DropReason) -> list[Drop]:
        drops = self._drop_oldest(len(self._order), reason)
        drops.sort(key=lambda drop: drop.message.input)
        self._losses.forget()
        return drops

    def buffered(self, place: int) -> int:
        return sum(messages[place] is not None for messages in self._sets.values())

    def needed_queue(self, place: int) -> int | None:
        return self._losses.needed[place]

    def _begin(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        messages: list[Message | None] = [None] * self.n_inputs
        messages[place] = message
        self._sets[stamp] = messages
        insort(self._order, stamp)
        if self.n_inputs == 1:
            return self._emit(stamp, messages)
        if len(self._order) > self._queue_size:
            return self._overflow(place, stamp)
        return ()

    def _overflow(self, place: int, stamp: int) -> Sequence[Outcome]:
        oldest = self._order[0]
        if oldest == stamp:
            for other in range(self.n_inputs):
                if other != place:
                    self._losses.miss(other, self._order[1:], stamp, before=0, after=0)
        else:
            for other, message in enumerate(self._sets[oldest]):
                if message is not None:
                    self._losses.lose(other, oldest)
        return self._drop_oldest(1, DropReason.OVERFLOW)

    def _emit(self, stamp: int, messages: list[Message | None]) -> list[Outcome]:
        outcomes: list[Outcome] = []
        if self._order[0] != stamp:
            outcomes += self._drop_oldest(bisect_left(self._order, stamp), DropReason.SUPERSEDED)
        del self._order[0]
        del self._sets[stamp]
        outcomes.append(Match(tuple(messages)))
        return outcomes

    def _drop_oldest(self, count: int, reason: DropReason) -> list[Drop]:
        stamps = self._order[:count]
        del self._order[:count]
        gone = [self._sets.pop(stamp) for stamp in stamps]
        return [Drop(message, reason) for messages in gone for message in messages if message is not None]
