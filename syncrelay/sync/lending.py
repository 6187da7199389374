"""What an engine lends: the search of approximate_time, for another that goes on with it and then gives it back.

The words are those of ApproximateTime. Stamps and durations are nanoseconds.
"""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from syncrelay.sync.messages import DropReason, Message

MOST_LENT: Final = 1024
"""A search of more messages than this is not lent."""
LARGEST_NS: Final = 2**62
"""Stamps and durations below this can be added and compared in 64 bits."""


class SearchTerms(NamedTuple):
    """What a search goes by; `scale` is 1 + `age_penalty`, as a numerator and a denominator."""

    queue_size: int
    slop_ns: int
    scale: tuple[int, int]
    min_periods_ns: Sequence[int]


class Search(NamedTuple):
    """Where a search stands.

    Of each input there are the messages in its queue, in stamp order, how many of them were passed, and the newest
    stamp that came. `candidate` is the pivot, its stamp, where the candidate starts and ends, and where it is proved.
    """

    queues: Sequence[Sequence[Message]]
    cursors: Sequence[int]
    newest: Sequence[int]
    candidate: tuple[int, int, int, int, int] | None


class Fed(NamedTuple):
    """What came of an input while its engine lent: how many, how many were dropped, the newest stamp in a set."""

    messages: int
    dropped: Mapping[DropReason, int]
    given: int
