"""An inbox on any watch: each wake drains all sources that are ready, and delivers their messages as they arrived.

DDS keeps order within a topic only. Drained one topic after the other, a backlog of a fast topic would overflow its
queues before a slow topic's messages of the same time are seen.
"""

from collections.abc import Iterable, Sequence
from heapq import heappop, heappush
from itertools import count
from typing import TYPE_CHECKING, Final, TypeAlias

from syncrelay.dataflow.backend import ALL, Payload, Source, Watch
from syncrelay.runtime import SYSTEM, Runtime

if TYPE_CHECKING:
    from collections.abc import Mapping

_Head: TypeAlias = tuple[int, int, Payload, Source]

# At most this many are delivered at a time, so that calls and deadlines do not wait for the end of a flood.
_BATCH: Final = 256


class Backlog:
    """Takes messages and delivers them, the oldest first; at most one of each source is held between calls."""

    def __init__(self) -> None:
        self._heads: list[_Head] = []
        self.held: set[Source] = set()
        """The sources of the messages that are held."""
        self.failed: dict[Source, Exception] = {}
        """The sources that could not be drained, and why."""
        self._ties = count()

    def deliver(self, sources: Sequence[Source], until: int) -> None:
        """Deliver the messages that were received before the poll at `until`, the oldest first, a batch at most.

        A message that came after the poll is held: a source that had none at the poll may have an older one by now.
        A message that was held before is due even if the clock was set back since: all sources have been polled again.
        """
        heads, due = self._heads, until
        for head in heads:
            due = max(due, head[0])
        for source in sources:
            if source not in self.held:
                self._take(source)
        for _ in range(_BATCH):
            if not heads or heads[0][0] > due:
                return
            self._take(self._hand_on(heappop(heads), until))

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
            self.held.add(source)
            heappush(self._heads, (payload.received, next(self._ties), payload, source))


class PolledInbox:
    """An Inbox that drains the sources which a watch names."""

    def __init__(self, watch: Watch, *, runtime: Runtime = SYSTEM) -> None:
        self._watch = watch
        self._monotonic_ns = runtime.monotonic_ns
        self._time_ns = runtime.time_ns
        # In the order in which they were added.
        self._sources: dict[Source, None] = {}
        self._backlog = Backlog()
        self.failed: Mapping[Source, Exception] = self._backlog.failed
        self.wake = watch.wake

    def add(self, source: Source) -> None:
        self._watch.add(source)
        self._sources[source] = None

    def remove(self, source: Source) -> None:
        self._backlog.forget(source)
        if source in self._sources:
            del self._sources[source]
            self._watch.remove(source)
            # Whoever removes it during a delivery may destroy it next: nothing more is taken from it.
            source.pending = 0

    def receive(self, longest_ns: int) -> None:
        end = self._monotonic_ns() + longest_ns
        rest = longest_ns
        while rest > 0 and not (self._turn(rest) or self.failed):
            rest = end - self._monotonic_ns()

    def receive_once(self, longest_ns: int) -> None:
        self._turn(longest_ns)

    def _turn(self, longest_ns: int) -> bool:
        """Receive once; whether there was a wake."""
        backlog = self._backlog
        sources, until, woken = self._watch.wait(0 if backlog.held else longest_ns)
        backlog.deliver(sources, until)
        return woken

    def deliver_all(self) -> None:
        self._backlog.deliver_until(self._time_ns(), self._sources)

    def deliver_held(self) -> None:
        self._backlog.deliver_held()

    def close(self) -> None:
        self._watch.close()
