"""exact_time: messages of equal stamps are a set."""

from bisect import bisect_left, insort
from collections.abc import Sequence

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome


class ExactTime:
    """Messages of equal stamps on all inputs are a set, and leave when the last of them is there.

    As C++ message_filters' ExactTime: what is older than a set that leaves is superseded, and `queue_size` is
    the number of distinct stamps kept over all inputs; above it the oldest stamp overflows, be it the newest
    arrival.
    """

    __slots__ = ("_order", "_queue_size", "_sets", "n_inputs")

    def __init__(self, *, n_inputs: int, queue_size: int) -> None:
        if n_inputs < 1 or queue_size < 1:
            raise ValueError(f"n_inputs {n_inputs} and queue_size {queue_size} must be 1 or more")
        self.n_inputs = n_inputs
        self._queue_size = queue_size
        self._sets: dict[int, list[Message | None]] = {}
        self._order: list[int] = []

    def add(self, message: Message) -> Sequence[Outcome]:
        """Take a message by its own input and stamp; give what leaves because of it, in order."""
        return self.feed(message.input, message.stamp, message)

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        """Take a message to be matched at `place` and `stamp`; its own input and stamp are not looked at."""
        messages = self._sets.get(stamp)
        if messages is None:
            messages = [None] * self.n_inputs
            messages[place] = message
            return self._open(stamp, messages)
        replaced = messages[place]
        messages[place] = message
        if replaced is not None:
            return (Drop(replaced, DropReason.DUPLICATE),)
        if None in messages:
            return ()
        return self._emit(stamp, messages)

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop all that is buffered, oldest first, and be as new."""
        drops = self._drop_oldest(len(self._order), reason)
        drops.sort(key=lambda drop: drop.message.input)
        return drops

    def buffered(self, place: int) -> int:
        """How many messages of this input are in here and in no set yet."""
        return sum(messages[place] is not None for messages in self._sets.values())

    def _open(self, stamp: int, messages: list[Message | None]) -> Sequence[Outcome]:
        order = self._order
        self._sets[stamp] = messages
        if not order or stamp > order[-1]:
            order.append(stamp)
        else:
            insort(order, stamp)
        if self.n_inputs == 1:
            return self._emit(stamp, messages)
        if len(order) > self._queue_size:
            return self._drop_oldest(1, DropReason.OVERFLOW)
        return ()

    def _emit(self, stamp: int, messages: list[Message | None]) -> list[Outcome]:
        order = self._order
        outcomes: list[Outcome] = []
        if order[0] != stamp:
            outcomes += self._drop_oldest(bisect_left(order, stamp), DropReason.SUPERSEDED)
        del order[0]
        del self._sets[stamp]
        outcomes.append(Match(tuple(messages)))
        return outcomes

    def _drop_oldest(self, count: int, reason: DropReason) -> list[Drop]:
        stamps = self._order[:count]
        del self._order[:count]
        gone = [self._sets.pop(stamp) for stamp in stamps]
        return [Drop(message, reason) for messages in gone for message in messages if message is not None]
