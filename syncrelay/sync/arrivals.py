"""Whether a message that arrives is late, of the time before a jump, or of use: by the stamps of its input."""

import sys
from collections.abc import Sequence

from syncrelay.sync.messages import Message

JUMP_NS = 1_000_000_000
"""If a stamp falls by more than this, a recording was looped or a clock was reset; the message is not just late."""

_UNSEEN = 0
_NOT_YET = sys.maxsize
_NEVER = -sys.maxsize


class Arrivals:
    """The newest stamp that arrived and the newest that went into a set, of each input.

    A message that is newer than `newest` of its input is of use; the caller checks that and updates `newest`. This
    class decides about all others. After one input has jumped back, the others may still send messages of the time
    before: their stamps continue where their input was, by no more than a second, and are more than a second ahead of
    the input that jumped.
    """

    __slots__ = ("_before", "_given", "_jumped", "_offsets", "newest")

    def __init__(self, offsets_ns: Sequence[int]) -> None:
        self._offsets = offsets_ns
        self.newest = [_UNSEEN] * len(offsets_ns)
        self._given = [_NEVER] * len(offsets_ns)
        self.forget()

    def forget(self) -> None:
        """Start afresh."""
        self._before: list[int | None] = [None] * len(self._offsets)
        self.newest[:] = [_UNSEEN] * len(self._offsets)
        self._given[:] = [_NEVER] * len(self._offsets)

    def give(self, messages: Sequence[Message | None]) -> None:
        """Note the stamps of the messages that went into a set."""
        given = self._given
        for message in messages:
            if message is not None and message.stamp > given[message.input]:
                given[message.input] = message.stamp

    def note_set(self, stamps: Sequence[int]) -> None:
        """Note the stamps of a set that is newer than all that came before."""
        self.newest[:] = self._given[:] = stamps

    def note_lent(self, newest: Sequence[int], given: Sequence[int]) -> None:
        """Note the newest stamps that came, and that went into sets, while the engine lent its search."""
        self.newest[:] = newest
        self._given[:] = map(max, self._given, given)

    def is_late(self, index: int, stamp: int, *, or_equal: bool) -> bool:
        """Whether a set with this stamp would be older than one that left. `or_equal`: equal stamps are late, too."""
        given = self._given[index]
        return stamp < given or (or_equal and stamp == given)

    def has_fallen(self, index: int, stamp: int) -> bool:
        """Whether the stamp is of a new time, after a jump back."""
        newest = self.newest[index]
        return newest != _UNSEEN and stamp < newest - JUMP_NS

    def jump(self, index: int) -> None:
        """Start afresh because this input has jumped back. The others may still send messages of the time before."""
        before = [old if newest == _NOT_YET else newest for old, newest in zip(self._before, self.newest, strict=True)]
        self.forget()
        self._jumped = index
        self._before = before
        self._before[index] = None
        self.newest[:] = [_NOT_YET] * len(before)
        self.newest[index] = _UNSEEN

    def is_left_over(self, index: int, stamp: int) -> bool:
        """Whether a message belongs to the time before a jump of another input."""
        before = self._before[index]
        if before is None:
            return False
        ahead = stamp + self._offsets[index] - self.newest[self._jumped] - self._offsets[self._jumped]
        goes_on = ahead > JUMP_NS and before < stamp <= before + JUMP_NS
        if not goes_on:
            self._before[index] = None
            self.newest[index] = _UNSEEN
        return goes_on
