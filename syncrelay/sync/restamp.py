"""The common stamp that a set may be given."""

from collections.abc import Sequence
from enum import Enum

from syncrelay.sync.messages import Message


class Restamp(Enum):
    """Which stamp all messages of a set get: the smallest or the largest of those that came in."""

    EARLIEST = "earliest"
    LATEST = "latest"


def common_stamp(messages: Sequence[Message | None], restamp: Restamp | int) -> int:
    """Give the stamp in nanoseconds, by the stamps as they came in.

    An int names an input; where that optional input is missing, the earliest stamp stands in.
    """
    if restamp is Restamp.LATEST:
        return max(message.stamp for message in messages if message is not None)
    if isinstance(restamp, int):
        chosen = messages[restamp]
        if chosen is not None:
            return chosen.stamp
    return min(message.stamp for message in messages if message is not None)
