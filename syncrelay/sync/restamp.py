"""The common stamp that a set may be given."""

from enum import Enum

from syncrelay.sync.messages import Match


class Restamp(Enum):
    """Which stamp all messages of a set get: the smallest or the largest of those that came in, or the clock's tick."""

    EARLIEST = "earliest"
    LATEST = "latest"
    TICK = "tick"


def common_stamp(match: Match, restamp: Restamp | int) -> int:
    """Give the stamp in nanoseconds, by the stamps as they came in.

    An int names an input; where that optional input is missing, the earliest stamp stands in. TICK is for sets that a
    clock triggered.
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
