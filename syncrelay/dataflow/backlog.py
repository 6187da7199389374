"""Messages of many subscriptions in the order in which they arrived.

DDS keeps order within a topic only. Drained one topic after the other, a backlog of a fast topic would overflow its
queues before a slow topic's messages of the same time are seen.
"""

from collections.abc import Iterable
from heapq import heappop, heappush
from itertools import count
from typing import Any, Final, TypeAlias

from syncrelay.dataflow.backend import Content, Ready, Source, Taken

_Head: TypeAlias = tuple[int, int, Any, Content, Source]

# As many are delivered at a time, so that calls and deadlines need not wait for the end of a flood.
_BATCH: Final = 256


class Backlog:
    """Takes messages and delivers them, the oldest first; at most one of each source is held between calls."""

    def __init__(self) -> None:
        self._heads: list[_Head] = []
        self.held: set[Source] = set()
        """The sources that a held message is of."""
        self.failed: dict[Source, Exception] = {}
        """The sources that could not be drained, and why; the reader empties it."""
        self._ties = count()

    def deliver(self, ready: Ready) -> None:
        """Deliver what is the oldest as far as the poll can tell, a batch at most.

        What came after the poll is held: an older message may be in a source that had none at the time. A
        source of which nothing is held is drained.
        """
        sources, until = ready
        if len(sources) == 1 and not self.held:
            self._deliver_alone(sources[0], until)
            return
        for source in sources:
            if source not in self.held:
                self._take(source)
        for _ in range(_BATCH):
            if not self._heads or self._heads[0][0] > until:
                return
            self._take(self._hand_on(heappop(self._heads), until))

    def deliver_until(self, until: int, sources: Iterable[Source]) -> None:
        """Deliver what these sources received up to a time, in nanoseconds of the system clock, however much it is."""
        for source in sources:
            source.force_poll()
            if source not in self.held:
                self._take(source)
        while self._heads and self._heads[0][0] <= until:
            self._take(self._hand_on(heappop(self._heads), until))

    def deliver_held(self) -> None:
        """Deliver what is held, at the end: its sources are not drained."""
        while self._heads:
            head = heappop(self._heads)
            self._hand_on(head, head[0])

    def forget(self, source: Source) -> None:
        """Deliver what is held of a source that ends."""
        if source in self.held:
            head = next(head for head in self._heads if head[4] is source)
            self._heads.remove(head)
            self._heads.sort()
            self._hand_on(head, head[0])

    def _deliver_alone(self, source: Source, until: int) -> None:
        """Deliver as the only one what one source has, a batch at most: nearly always, and without any sorting."""
        try:
            taken = source.take()
            if taken is None:
                return
            source.waited = max(source.waited, until - taken[0])
            for _ in range(_BATCH):
                received, payload, content = taken
                if received > until:
                    break
                source.deliver(payload, content, received)
                taken = source.take()
                if taken is None:
                    return
        except Exception as error:  # noqa: BLE001  the loop hands it to who added the source
            self.failed[source] = error
            return
        self._hold(source, taken)

    def _hand_on(self, head: _Head, until: int) -> Source:
        received, _, payload, content, source = head
        self.held.discard(source)
        # Done for each message of a backlog: a call of `max` costs ten times as much.
        if until - received > source.waited:  # noqa: PLR1730
            source.waited = until - received
        try:
            source.deliver(payload, content, received)
        except Exception as error:  # noqa: BLE001
            self.failed[source] = error
        return source

    def _take(self, source: Source) -> None:
        try:
            taken = source.take()
        except Exception as error:  # noqa: BLE001
            self.failed[source] = error
            return
        if taken is not None:
            self._hold(source, taken)

    def _hold(self, source: Source, taken: Taken) -> None:
        received, payload, content = taken
        self.held.add(source)
        heappush(self._heads, (received, next(self._ties), payload, content, source))
