"""Thinning: which sets pass when not all may."""

from collections.abc import Sequence

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome

_EARLY = 4
"""A set that is early by up to a fourth of a period counts for the period that it is early for."""


class Thinning:
    """Lets the first of every `every` sets pass, and of those at most one in each period of `min_set_period_ns`.

    Periods count from the first set, so that sets pass evenly, and all sets of a source pass whose rate is the greatest
    and jitters. In any length of time, at most two sets more pass than it has periods.
    """

    __slots__ = ("_every", "_first", "_next_slot", "_period", "_seen", "_withheld")

    def __init__(self, *, n_inputs: int, repeats: bool, every: int, min_set_period_ns: int | None) -> None:
        if every < 1 or (min_set_period_ns is not None and min_set_period_ns < 1):
            raise ValueError(f"every {every} and min_set_period_ns {min_set_period_ns} must be 1 or more")
        self._every = every
        self._period = min_set_period_ns
        self._withheld = Withheld(n_inputs, DropReason.THINNED) if repeats else None
        self._reset()

    def thin(self, match: Match, stamp: int) -> Sequence[Outcome]:
        """Return the set, of this stamp, if it passes; otherwise the drops of its messages."""
        if self._passes(stamp):
            return (match,) if self._withheld is None else (*self._withheld.note_passed(match), match)
        if self._withheld is not None:
            return self._withheld.note_stopped(match)
        return [Drop(message, DropReason.THINNED) for message in match.messages if message is not None]

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop the withheld messages, and be as new: the next set is the first."""
        self._reset()
        return [] if self._withheld is None else self._withheld.flush(reason)

    def buffered(self, index: int) -> int:
        """How many messages of this input are withheld."""
        return 0 if self._withheld is None else self._withheld.buffered(index)

    def _reset(self) -> None:
        self._seen = 0
        self._first: int | None = None
        self._next_slot = 0

    def _passes(self, stamp: int) -> bool:
        self._seen += 1
        if (self._seen - 1) % self._every:
            return False
        if self._period is None:
            return True
        if self._first is None:
            self._first = stamp
        slot = (stamp - self._first + self._period // _EARLY) // self._period
        if slot < self._next_slot:
            return False
        self._next_slot = slot + 1
        return True


class Withheld:
    """Messages that have only been in sets that did not pass, of a policy whose messages may be in many sets.

    The newest of each input is kept, as it may still be in a set that passes, and is dropped once it cannot be.
    """

    __slots__ = ("_messages", "_passed", "_reason")

    def __init__(self, n_inputs: int, reason: DropReason) -> None:
        """Take the reason for which messages are dropped that will be in no set."""
        self._reason = reason
        self._messages: list[Message | None] = [None] * n_inputs
        self._passed: list[int | None] = [None] * n_inputs

    def note_passed(self, match: Match) -> list[Drop]:
        """Note a set that passed; return the drops of messages that will be in no other."""
        stopped = self._messages
        self._messages = [None] * len(stopped)
        for index, message in enumerate(match.messages):
            if message is not None:
                self._passed[index] = message.stamp
        return self._not_in(stopped, match.messages)

    def note_stopped(self, match: Match) -> list[Drop]:
        """Note a set that did not pass; return the drops of messages that will be in no other."""
        stopped = self._messages
        self._messages = [
            None if message is None or message.stamp == passed else message
            for message, passed in zip(match.messages, self._passed, strict=True)
        ]
        return self._not_in(stopped, self._messages)

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop everything, and be as new."""
        drops = [Drop(message, reason) for message in self._messages if message is not None]
        self._messages = [None] * len(self._messages)
        self._passed = [None] * len(self._messages)
        return drops

    def buffered(self, index: int) -> int:
        """Return how many messages of this input are withheld."""
        return int(self._messages[index] is not None)

    def stamp(self, index: int) -> int | None:
        """Return the stamp of the message of this input that is withheld; None where none is."""
        message = self._messages[index]
        return None if message is None else message.stamp

    def _not_in(self, stopped: Sequence[Message | None], messages: Sequence[Message | None]) -> list[Drop]:
        return [
            Drop(message, self._reason)
            for message, current in zip(stopped, messages, strict=True)
            if message is not None and message is not current
        ]
