"""The common stamp that a set may be given."""

from enum import Enum

from syncrelay.sync.messages import Match


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
