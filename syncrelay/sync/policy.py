"""What a policy is to the group that runs it."""

from collections.abc import Sequence
from typing import Protocol

from syncrelay.sync.messages import Drop, DropReason, Message, Outcome


class Policy(Protocol):
    """Matches the messages of `n_inputs` inputs. Knows stamps and order of arrival, never a clock."""

    @property
    def n_inputs(self) -> int:
        """How many inputs a set has."""
        ...

    def add(self, message: Message) -> Sequence[Outcome]:
        """Take a message by its own input and stamp; give what leaves because of it, in order."""
        ...

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        """Take a message to be matched at `place` and `stamp`; its own input and stamp are not looked at."""
        ...

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop all that is buffered, input by input, oldest first, and be as new."""
        ...

    def buffered(self, place: int) -> int:
        """How many messages of this input are in here and in no set yet."""
        ...
