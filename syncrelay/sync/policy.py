"""What a policy is to the group that runs it."""

from collections.abc import Sequence
from typing import Protocol

from syncrelay.sync.messages import Drop, DropReason, Message, Outcome


class OptionalStage(Protocol):
    """Where the sets of required inputs wait for messages of the optional ones."""

    __slots__ = ()

    inputs: Sequence[int]
    """The optional inputs."""

    @property
    def oldest_since(self) -> int | None:
        """Since when the oldest set waits."""
        ...

    def wait_from(self, now: int) -> None:
        """Let no wait have begun later than `now`: the clock fell."""
        ...

    def put(self, index: int, stamp: int, message: Message) -> list[Outcome]:
        """Take a message of an optional input; give what leaves because of it."""
        ...

    def hold(self, messages: tuple[Message | None, ...], low: int, high: int, since: int) -> list[Outcome]:
        """Take a set of the required inputs whose stamps go from `low` to `high`; give what leaves."""
        ...

    def leave(self) -> list[Outcome]:
        """Let the oldest set leave with what there is."""
        ...

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop all that is in here, and be as new."""
        ...

    def buffered(self, index: int) -> int:
        """How many messages of this input, required or not, are in here."""
        ...


class Policy(Protocol):
    """Matches the messages of `n_inputs` inputs. Knows stamps and order of arrival, never a clock.

    But one that is `by_clock` makes its sets as time passes, and is told so by `advance`.
    """

    __slots__ = ()

    by_stamp: bool = True
    """Whether a stamp must be set, and two of one input that are equal mean the same message."""

    by_clock: bool = False
    """Whether it makes its sets when time has passed, by `advance`, and none when a message is fed."""

    repeats: bool = False
    """Whether a message may be in more than one set."""

    waits_started: int = 0
    """How many waits began in here: for a better message or for a missing one."""

    waits_ended: int = 0
    """How many waits ended, in the order in which they began."""

    n_inputs: int
    """How many inputs a set has."""

    def for_required(self, required: Sequence[bool]) -> tuple["Policy", OptionalStage]:
        """Give this rule, as new, for a group in which only some inputs are required.

        Either a policy of the required inputs alone, places counted among them, and the stage in which the
        optional ones join its sets; or a policy that deals with them itself, and a stage of none.
        """
        ...

    def add(self, message: Message) -> Sequence[Outcome]:
        """Take a message by its own input and stamp; give what leaves because of it, in order."""
        return self.feed(message.input, message.stamp, message)

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        """Take a message to be matched at `place` and `stamp`; its own input and stamp are not looked at."""
        ...

    def advance(self, until: int) -> Sequence[Outcome]:
        """Give the sets of all times up to this one, if it is `by_clock`; in nanoseconds, in which stamps are too."""
        del until
        return ()

    def next_tick(self) -> int | None:
        """Up to when to `advance` for the next set, if no other message is fed."""
        return None

    def pass_over(self, until: int) -> None:
        """Let time pass up to this one without giving its sets."""
        del until

    def release_oldest(self) -> Sequence[Outcome]:
        """End the oldest wait: what it is for leaves as it is, as a set if it can be one."""
        return ()

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop all that is buffered, input by input, oldest first, and be as new."""
        ...

    def let_go(self, reason: DropReason) -> list[Drop]:
        """Drop what waits for others; the latest of what serves in many sets may stay."""
        return self.flush(reason)

    def buffered(self, place: int) -> int:
        """How many messages of this input are in here and have been in no set."""
        ...

    def needed_queue(self, place: int) -> int | None:
        """How long this input's queue should have been at most, by the messages that missed what it had dropped."""
        ...


def check_sizes(n_inputs: int, queue_size: int) -> None:
    """Raise ValueError for what no policy can be made of."""
    if n_inputs < 1 or queue_size < 1:
        raise ValueError(f"n_inputs {n_inputs} and queue_size {queue_size} must be 1 or more")


def of_required(values: Sequence[int], required: Sequence[bool]) -> tuple[int, ...]:
    """Keep the values of the required inputs."""
    return tuple(value for value, needed in zip(values, required, strict=True) if needed)
