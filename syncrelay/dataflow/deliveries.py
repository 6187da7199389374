"""What each message says of its publisher's: how many were sent, how many came, and how long they were on the way.

rmw tells of each message which publisher sent it, as which of its messages, and when. Within one publisher messages
are taken in the order of their numbers, those that were sent again too: DDS holds back what came after a gap until the
gap is filled or given up. So a number that was passed over is a message that never comes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

GID_BYTES: Final = 16
"""The graph may show more: rmw pads a gid to 24 bytes in some versions."""
MOST_PUBLISHERS: Final = 16
"""So many publishers of a topic are counted apart; the one that was silent for longest is forgotten for another."""
LARGEST_GAP: Final = 10**9
"""A publisher whose numbers leap by more is counted anew: whoever writes DDS by hand may number as it likes."""


class Deliveries(NamedTuple):
    """What came of one publisher; times in nanoseconds, those of its publication by its own machine's clock.

    What was published before the first message that came is no loss.
    """

    gid: bytes | None
    """Which publisher, as the graph has it. None where the backend does not tell."""
    first: int
    """The number of the first message that came. DDS counts from 1."""
    newest: int
    """The number of the newest."""
    delivered: int
    """How many came."""
    published: int
    """When the newest was published."""
    longest_gap: int
    """The most messages in a row that did not come, since this was last asked for."""
    least_way: int | None
    """The least time from publication to receipt since this was last asked for. None if no message came."""

    @property
    def sent(self) -> int:
        """How many were sent from the first that came to the newest."""
        return self.newest - self.first + 1


@dataclass(slots=True)
class _Count:
    first: int
    newest: int
    published: int
    seen: int = 0
    delivered: int = 0
    longest_gap: int = 0
    least_way: int | None = None


class Tally:
    """Counts what came, publisher by publisher; in compiled code, path.Source does the same.

    Without gids all messages count as one publisher's: one that restarts begins anew, as its numbers fall, but several
    at once cannot be told apart.
    """

    def __init__(self) -> None:
        self._counts: dict[bytes | None, _Count] = {}
        self._seen = 0

    def note(self, gid: bytes | None, number: int | None, published: int, received: int) -> None:
        """Take what rmw says of a message; `number` is None where it does not number them."""
        if number is None:
            return
        self._seen += 1
        count = self._counts.get(gid)
        if count is None:
            if len(self._counts) == MOST_PUBLISHERS:
                del self._counts[min(self._counts, key=lambda each: self._counts[each].seen)]
            count = self._counts[gid] = _Count(number, number, published)
        gap = number - count.newest - 1
        if gap > LARGEST_GAP or (gap < 0 and count.delivered):
            count.first, count.newest, count.delivered, gap = number, number, 0, 0
        count.longest_gap = max(count.longest_gap, gap)
        count.newest, count.published, count.seen = number, published, self._seen
        count.delivered += 1
        way = received - published
        if count.least_way is None or way < count.least_way:
            count.least_way = way

    def read(self) -> Sequence[Deliveries]:
        """Give the counts. The longest gaps and the least ways are those since they were last read."""
        counts = [
            Deliveries(gid, each.first, each.newest, each.delivered, each.published, each.longest_gap, each.least_way)
            for gid, each in self._counts.items()
        ]
        for each in self._counts.values():
            each.longest_gap, each.least_way = 0, None
        return counts
