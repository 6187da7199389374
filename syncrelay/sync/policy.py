"""What a group requires of a policy."""

from collections.abc import Sequence
from typing import Final, Protocol

from syncrelay.sync.lending import Search, SearchTerms
from syncrelay.sync.messages import Drop, DropReason, Message, Outcome
from syncrelay.sync.queues import Losses, StampQueue
from syncrelay.sync.waiting import OptionalStage

# Farther apart than stamps can be, which have 32 bits of seconds.
_ANY_DISTANCE: Final = 2**63


class Policy(Protocol):
    """Matches the messages of `n_inputs` inputs, by stamps and order of arrival.

    A policy has no clock. One that is `by_clock` makes its sets when `advance` says that time has passed.
    """

    __slots__ = ()

    by_stamp: bool = True
    """Whether messages need a stamp, and equal stamps of one input mean the same message."""

    by_clock: bool = False
    """Whether it makes its sets when time passes, in `advance`, and none when a message is fed."""

    repeats: bool = False
    """Whether a message may be in more than one set."""

    waits_started: int = 0
    """How many waits have begun, for a better message or for a missing one."""

    waits_ended: int = 0
    """How many waits have ended, in the order in which they began."""

    n_inputs: int
    """How many inputs a set has."""

    @property
    def at_once(self) -> int | None:
        """How far apart in nanoseconds the first messages of all inputs may be to leave as a set with the last of them.

        None where they may have to wait, or where one that is no farther from the others may be dropped.
        """
        return None

    @property
    def is_new(self) -> bool:
        """Whether nothing is buffered, and nothing remembered that what is fed is matched by."""
        return False

    @property
    def search_terms(self) -> SearchTerms | None:
        """What its search goes by, where that can be lent; None where it cannot."""
        return None

    def lend(self, newest: Sequence[int]) -> Search | None:
        """Let another go on with the search, given the newest stamp of each input; None where it cannot now."""
        del newest
        return None

    def take_back(self, search: Search) -> None:
        """Go on where another has left the search."""
        del search
        raise AssertionError("this policy lends no search")

    def for_required(self, required: Sequence[bool], quorum: int) -> tuple["Policy", OptionalStage]:
        """Return a new policy of the same options for a group in which only some inputs are required.

        It is either a policy of the required inputs alone, with places counted among them, and the stage where
        messages of the optional inputs join its sets; or a policy that deals with optional inputs itself, and a stage
        without inputs. A set has messages of `quorum` inputs or more. Where no input is required, the policy has none.
        """
        ...

    def add(self, message: Message) -> Sequence[Outcome]:
        """Take a message by its own input and stamp; return what leaves because of it, in order."""
        return self.feed(message.input, message.stamp, message)

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        """Take a message to be matched at `place` and `stamp`, whatever its own input and stamp."""
        ...

    def advance(self, until: int) -> Sequence[Outcome]:
        """Return the sets of all times up to this one, in the nanoseconds of stamps, if it is `by_clock`."""
        del until
        return ()

    def next_tick(self) -> int | None:
        """Return the time to `advance` to for the next set, if no other message is fed."""
        return None

    def pass_over(self, until: int) -> None:
        """Let time pass up to this one without its sets."""
        del until

    def release_oldest(self) -> Sequence[Outcome]:
        """End the oldest wait. What waited leaves as it is, as a set if it can be one."""
        raise AssertionError("no message of this policy waits")

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop everything that is buffered, input by input, oldest first, and be as new."""
        ...

    def let_go(self, reason: DropReason) -> list[Drop]:
        """Drop what waits for other messages. The latest message of an input may stay if it can be in many sets."""
        return self.flush(reason)

    def buffered(self, place: int) -> int:
        """Return how many messages of this input are buffered and have been in no set."""
        ...

    def needed_queue(self, place: int) -> int | None:
        """Return how long a queue would have held all that other messages missed; None if nothing was missed."""
        ...


class Queued(Policy, Protocol):
    """A policy that keeps the messages of each input in a queue."""

    _queue_size: int
    _queues: list[StampQueue]
    _losses: Losses

    def make_queues(self, n_inputs: int, queue_size: int) -> None:
        """Have an empty queue for each input. Raises ValueError for sizes that no policy can have."""
        check_sizes(n_inputs, queue_size)
        self.n_inputs = n_inputs
        self._queue_size = queue_size
        self._queues = [StampQueue() for _ in range(n_inputs)]
        self._losses = Losses(n_inputs)

    def flush(self, reason: DropReason) -> list[Drop]:
        self._losses.forget()
        return [drop for queue in self._queues for drop in queue.drop(len(queue.stamps), reason)]

    @property
    def is_new(self) -> bool:
        return not any(queue.stamps for queue in self._queues)

    def buffered(self, place: int) -> int:
        return self._queues[place].unmatched

    def needed_queue(self, place: int) -> int | None:
        return self._losses.needed[place]


def limit_of(slop_ns: int | None, name: str = "slop_ns") -> int:
    """Return how far apart stamps may be, for None as far as any are. Raises ValueError if it is negative."""
    if slop_ns is not None and slop_ns < 0:
        raise ValueError(f"{name} {slop_ns} must be 0 or more, or None")
    return _ANY_DISTANCE if slop_ns is None else slop_ns


def check_sizes(n_inputs: int, queue_size: int) -> None:
    """Raise ValueError for sizes that no policy can have."""
    if n_inputs < 0 or queue_size < 1:
        raise ValueError(f"n_inputs {n_inputs} must be 0 or more, queue_size {queue_size} must be 1 or more")


def of_required(values: Sequence[int], required: Sequence[bool]) -> tuple[int, ...]:
    """Return the values of the required inputs."""
    return tuple(value for value, needed in zip(values, required, strict=True) if needed)
