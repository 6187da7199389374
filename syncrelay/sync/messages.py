"""The values that go into the engine and come out of it."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Generic, TypeAlias

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
    """Why a message left without a set. Each unmatched message has exactly one."""

    # Enum's own hash is Python code: a third of the time of counting a drop. Members are singletons.
    __hash__ = object.__hash__

    LATE = "late"
    DUPLICATE = "duplicate"
    OVERFLOW = "overflow"
    SUPERSEDED = "superseded"
    TOO_FAR = "too_far"
    EXPIRED = "expired"
    TIME_JUMP = "time_jump"
    UNSTAMPED = "unstamped"
    MALFORMED = "malformed"
    THINNED = "thinned"
    PAUSED = "paused"
    SHUTDOWN = "shutdown"

    @property
    def meaning(self) -> str:
        """What it says of the message, in a few words."""
        return _MEANINGS[self]


_MEANINGS: Final[Mapping[DropReason, str]] = MappingProxyType(
    {
        DropReason.LATE: "older than the last set",
        DropReason.DUPLICATE: "its stamp came twice",
        DropReason.OVERFLOW: "its queue was full",
        DropReason.SUPERSEDED: "a newer set left",
        DropReason.TOO_FAR: "no partner near enough",
        DropReason.EXPIRED: "waited too long",
        DropReason.TIME_JUMP: "timestamps jumped back",
        DropReason.UNSTAMPED: "its stamp is 0",
        DropReason.MALFORMED: "no stamp could be read",
        DropReason.THINNED: "its set was left out",
        DropReason.PAUSED: "the relay was paused",
        DropReason.SHUTDOWN: "its group stopped",
    }
)


@dataclass(slots=True, unsafe_hash=True)
class Message(Generic[T]):
    """One message of one input: index from 0, stamp in nanoseconds, a payload of type T that the engine never opens.

    `key` is what `equal_key` matches by; the other policies leave it alone.
    """

    input: int
    stamp: int
    payload: T
    key: Hashable = None


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
