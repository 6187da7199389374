"""Queues in stamp order, and how long a queue that was too short should have been."""

from bisect import bisect_left, bisect_right, insort
from collections.abc import Sequence

from syncrelay.sync.messages import Drop, DropReason, Message

LONGEST_QUEUE = 1000
"""A longer queue is never suggested: only stamps of another clock would need it."""


class StampQueue:
    """Messages of one input in stamp order, each stamp once. `stamps` and `messages` run in parallel.

    `is_served` says that the first message has been in a set: when it is removed, it leaves matched.
    """

    __slots__ = ("is_served", "messages", "stamps")

    def __init__(self) -> None:
        self.stamps: list[int] = []
        self.messages: list[Message] = []
        self.is_served = False

    def __len__(self) -> int:
        return len(self.stamps)

    @property
    def unmatched(self) -> int:
        """How many messages have been in no set."""
        return len(self.stamps) - self.is_served

    def insert(self, stamp: int, message: Message) -> Message | None:
        """Put a message in its place; return the one of the same stamp that it replaces, if there is one."""
        stamps = self.stamps
        if not stamps or stamp > stamps[-1]:
            stamps.append(stamp)
            self.messages.append(message)
            return None
        position = bisect_left(stamps, stamp)
        if stamps[position] == stamp:
            replaced = self.messages[position]
            self.messages[position] = message
            return replaced
        stamps.insert(position, stamp)
        self.messages.insert(position, message)
        return None

    def remove(self, position: int) -> Message:
        """Remove one message and return it."""
        del self.stamps[position]
        return self.messages.pop(position)

    def take(self, count: int) -> list[Message]:
        """Remove the oldest `count` messages and return them."""
        taken = self.messages[:count]
        del self.messages[:count], self.stamps[:count]
        return taken

    def drop(self, count: int, reason: DropReason) -> list[Drop]:
        """Remove the oldest `count` messages; return the drops of those that have been in no set."""
        taken = self.messages[:count]
        del self.messages[:count], self.stamps[:count]
        if taken and self.is_served:
            self.is_served = False
            del taken[0]
        return [Drop(message, reason) for message in taken]


class Losses:
    """The messages that queues lost by overflow, and how long the queues should have been.

    `needed` is the greatest such length for each place, up to LONGEST_QUEUE.
    """

    __slots__ = ("_lost", "needed")

    def __init__(self, n_inputs: int) -> None:
        self._lost: list[list[int]] = [[] for _ in range(n_inputs)]
        self.needed: list[int | None] = [None] * n_inputs

    def forget(self) -> None:
        """Forget the lost messages, but keep what was needed."""
        self._lost = [[] for _ in self._lost]

    def reach(self, since: int) -> bool:
        """Whether a lost message is of this stamp or newer."""
        return any(lost and lost[-1] >= since for lost in self._lost)

    def lose(self, place: int, stamp: int) -> None:
        """Note that the queue of `place` dropped its oldest message, of this stamp."""
        lost = self._lost[place]
        insort(lost, stamp)
        del lost[:-LONGEST_QUEUE]

    def miss(self, place: int, stamps: Sequence[int], wanted: int, *, before: int, after: int) -> None:
        """Note that a message of stamp `wanted` found only newer ones in this queue, `stamps`.

        This matters if the queue lost one that was older by no more than `before`, or newer by no more than `after`.
        The length is that of a queue that would still hold it, plus one: a set may wait for the next message.
        """
        lost = self._lost[place]
        position = bisect_right(lost, wanted)
        if position and lost[position - 1] >= wanted - before:
            position -= 1
        elif position == len(lost) or lost[position] > wanted + after:
            return
        self.need(place, len(lost) - position + len(stamps) + 1)

    def need(self, place: int, length: int) -> None:
        """Note that a queue of this length would have held what was missed."""
        if (self.needed[place] or 0) < length <= LONGEST_QUEUE:
            self.needed[place] = length
