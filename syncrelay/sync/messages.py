"""The values that go into the engine and come out of it."""

from collections.abc import Hashable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, Generic, Self, TypeAlias

if TYPE_CHECKING:
    # A default is what spares those who have payloads of many types from writing Message[Any]. Python 3.13 has it.
    from typing_extensions import TypeVar

    T = TypeVar("T", default=Any)
else:
    from typing import TypeVar

    T = TypeVar("T")

# None of these changes once it is made, so they may be hashed. Frozen ones take three times as long to make,
# NamedTuples nearly twice: with a message and a drop each, a fifth of what the engine needs.


class DropReason(Enum):
    """Why a message left without a set. Each unmatched message has exactly one.

    `meaning` says it in a few words, `explanation` in full: docs/reference/drop_reasons.md is made of these.
    """

    # Enum's own hash is Python code: a third of the time of counting a drop. Members are singletons.
    __hash__ = object.__hash__

    _value_: str
    meaning: str
    explanation: str

    # The defaults are for type checkers, which take DropReason("late") for a call of this.
    def __new__(cls, reason: str, meaning: str = "", explanation: str = "") -> Self:
        """Return the member whose value is the reason alone."""
        member = object.__new__(cls)
        member._value_ = reason
        member.meaning, member.explanation = meaning, explanation
        return member

    LATE = (
        "late",
        "older than the last set",
        (
            "It is older than the last message of its input that went into a set, or, with a `quorum`, than the message"
            " that the last set was made round."
        ),
    )
    DUPLICATE = ("duplicate", "its stamp came twice", "A later message of the same stamp replaced it.")
    OVERFLOW = (
        "overflow",
        "its queue was full",
        (
            "Its queue was full: `queue_size` is too short for the gap in rates, or no partner was left for it, as for"
            " most of a fast topic beside a slow one: then no set is missed."
        ),
    )
    SUPERSEDED = (
        "superseded",
        "a newer set left",
        (
            "A newer message of its input, one that fits better, went into a set; or a newer set left, and its own"
            " still lacked inputs of its `quorum`."
        ),
    )
    TOO_FAR = (
        "too_far",
        "no partner near enough",
        (
            "Nothing within slop (for a trigger: within `max_age`) could still come, or too little for a `quorum`:"
            " mostly what a fast topic sends between two messages of a slow one."
        ),
    )
    EXPIRED = ("expired", "waited too long", "It waited, or aged, longer than allowed.")
    TIME_JUMP = (
        "time_jump",
        "timestamps jumped back",
        "Stamps of its group or the clock jumped back by more than a second: a recording began again.",
    )
    UNSTAMPED = ("unstamped", "its stamp is 0", "Its stamp is zero: the driver does not fill it in.")
    MALFORMED = ("malformed", "no stamp could be read", "No stamp could be read from its bytes.")
    THINNED = ("thinned", "its set was left out", "Its set was left out by `max_rate` or `every`.")
    NO_TRANSFORM = (
        "no_transform",
        "could not be transformed",
        "Its set could not be transformed to the `target` of `transforms` within `wait`.",
    )
    PAUSED = ("paused", "the relay was paused", "It was waiting when the relay was paused, or came while it was.")
    SHUTDOWN = (
        "shutdown",
        "its group stopped",
        (
            "It was waiting when its group stopped: the relay ended or was deactivated, a reload changed the group, or"
            " nobody listened to a lazy one any more."
        ),
    )


@dataclass(slots=True, unsafe_hash=True)
class Message(Generic[T]):
    """One message of one input: index from 0, stamp in nanoseconds, a payload of type T that the engine never opens.

    `key` is what `equal_key` matches by; the other policies leave it alone. `frame` is the coordinate frame that sets
    wait for the transforms of, where a group has any; None needs none.
    """

    input: int
    stamp: int
    payload: T
    key: Hashable = None
    frame: str | None = None


@dataclass(slots=True, unsafe_hash=True)
class Match(Generic[T]):
    """A set: one message per input in input order, None where an optional one is missing.

    `stamp` is the common stamp in nanoseconds that the group's restamping gives the set; None leaves each
    message its own. `tick` is the tick of the clock that triggered it, None where no clock did.
    """

    messages: tuple[Message[T] | None, ...]
    stamp: int | None = None
    tick: int | None = None

    @property
    def stamps(self) -> tuple[int | None, ...]:
        """The stamps that the messages came with."""
        return tuple([None if message is None else message.stamp for message in self.messages])


@dataclass(slots=True, unsafe_hash=True)
class Drop(Generic[T]):
    """A message that leaves unmatched."""

    message: Message[T]
    reason: DropReason


Outcome: TypeAlias = Match[T] | Drop[T]
"""What leaves a group: a set, or a message that found none."""


class Restamp(Enum):
    """The common stamp of a set: the earliest or the latest that its messages came with, or the clock's tick."""

    EARLIEST = "earliest"
    LATEST = "latest"
    TICK = "tick"


def common_stamp(match: Match, restamp: Restamp | int) -> int:
    """Return the common stamp in nanoseconds.

    An int names an input whose stamp is taken; where the set lacks that input, the earliest stamp is. TICK is for sets
    that a clock triggered.
    """
    messages = match.messages
    if restamp is Restamp.LATEST:
        return max(message.stamp for message in messages if message is not None)
    if restamp is Restamp.TICK and match.tick is not None:
        return match.tick
    if isinstance(restamp, int):
        chosen = messages[restamp]
        if chosen is not None:
            return chosen.stamp
    return min(message.stamp for message in messages if message is not None)
