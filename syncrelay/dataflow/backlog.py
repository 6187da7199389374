"""Messages of many subscriptions in the order in which they arrived.

DDS keeps order within a topic only. Drained one topic after the other, a backlog of a fast topic would overflow its
queues before a slow topic's messages of the same time are seen.
"""

from collections.abc import Iterable, Sequence
from heapq import heappop, heappush
from itertools import count
from typing import Final, TypeAlias

from syncrelay.dataflow.backend import ALL, Payload, Source

_Head: TypeAlias = tuple[int, int, Payload, Source]

# As many are delivered at a time, so that calls and deadlines need not wait for the end of a flood.
_BATCH: Final = 256


class Backlog:
    """Takes messages and delivers them, the oldest first; at most one of each source is held between calls."""

    def __init__(self) -> None:
        self._heads: list[_Head] = []
        self.held: set[Source] = set()
        """The sources that a held message is of."""
        self.failed: dict[Source, Exception] = {}
        """The sources that could not be drained, and why."""
        self._ties = count()

    def deliver(self, sources: Sequence[Source], until: int) -> None:
        """Deliver what is the oldest as far as a poll at `until` can tell, a batch at most.

        What came after the poll is held: an older message may be in a source that had none at the time. A
        source of which nothing is held is drained. What was held before is due, though the clock was set back since:
        all sources have been polled again.
        """
        due = max([until, *(head[0] for head in self._heads)])
        for source in sources:
            if source not in self.held:
                self._take(source)
        for _ in range(_BATCH):
            if not self._heads or self._heads[0][0] > due:
                return
            self._take(self._hand_on(heappop(self._heads), until))

    def deliver_until(self, until: int, sources: Iterable[Source]) -> None:
        """Deliver what these sources received up to a time, in nanoseconds of the system clock, however much it is."""
        for source in sources:
            source.pending = ALL
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
            head = next(head for head in self._heads if head[3] is source)
            self._heads.remove(head)
            self._heads.sort()
            self._hand_on(head, head[0])
        self.failed.pop(source, None)

    def deliver_alone(self, source: Source, until: int) -> None:
        """Deliver what one source has, as nearly always, while nothing is held: without any sorting."""
        left = _BATCH
        try:
            while source.pending:
                payload = source.take()
                if payload is None:
                    return
                waited = until - payload.received
                if waited < 0 or not left:
                    self._hold(source, payload)
                    return
                source.waited = max(source.waited, waited)
                left -= 1
                source.deliver(payload)
        except Exception as error:  # noqa: BLE001  the loop hands it to who added the source
            self.failed[source] = error

    def _hand_on(self, head: _Head, until: int) -> Source:
        received, _, payload, source = head
        self.held.discard(source)
        # Done for each message of a backlog: a call of `max` costs ten times as much.
        if until - received > source.waited:  # noqa: PLR1730
            source.waited = until - received
        try:
            source.deliver(payload)
        except Exception as error:  # noqa: BLE001
            self.failed[source] = error
        return source

    def _take(self, source: Source) -> None:
        if not source.pending:
            return
        try:
            payload = source.take()
        except Exception as error:  # noqa: BLE001
            self.failed[source] = error
            return
        if payload is not None:
            self._hold(source, payload)

    def _hold(self, source: Source, payload: Payload) -> None:
        self.held.add(source)
        heappush(self._heads, (payload.received, next(self._ties), payload, source))
