"""An inbox on any watch: each wake drains all sources that are ready."""

import time
from typing import TYPE_CHECKING, Final

from syncrelay.dataflow.backend import Source, Watch
from syncrelay.dataflow.backlog import Backlog

if TYPE_CHECKING:
    from collections.abc import Mapping

_NS_PER_SECOND: Final = 1_000_000_000


class PolledInbox:
    """Drains the sources that a watch names.

    When a message comes, it waits `coalesce_ns` for others before it takes them all.
    """

    def __init__(self, watch: Watch, *, coalesce_ns: int = 0) -> None:
        self._watch = watch
        self._coalesce_s = coalesce_ns / _NS_PER_SECOND
        # In the order in which they were added.
        self._sources: dict[Source, None] = {}
        self._backlog = Backlog()
        self.failed: Mapping[Source, Exception] = self._backlog.failed
        self.wake = watch.wake

    def add(self, source: Source) -> None:
        """Drain one more source."""
        self._watch.add(source)
        self._sources[source] = None

    def remove(self, source: Source) -> None:
        """Deliver what is held of a source, and drain it no longer."""
        self._backlog.forget(source)
        if source in self._sources:
            del self._sources[source]
            self._watch.remove(source)
            # Who removes it in the midst of a delivery may destroy it.
            source.pending = 0

    def receive(self, longest_ns: int) -> None:
        """Deliver what comes for so long, or until a wake or a failure."""
        end = time.monotonic_ns() + longest_ns
        rest = longest_ns
        while rest > 0 and not (self._turn(rest) or self.failed):
            rest = end - time.monotonic_ns()

    def receive_once(self, longest_ns: int) -> None:
        """Wait for messages, for so long at most or until a wake, and deliver them."""
        self._turn(longest_ns)

    def _turn(self, longest_ns: int) -> bool:
        """Receive once; whether there was a wake."""
        backlog = self._backlog
        sources, until, woken = self._watch.wait(0 if backlog.held else longest_ns)
        if sources and self._coalesce_s and not backlog.held:
            time.sleep(self._coalesce_s)
            more, until, woken_since = self._watch.wait(0)
            sources, woken = [*sources, *(each for each in more if each not in sources)], woken or woken_since
        if len(sources) == 1 and not backlog.held:
            backlog.deliver_alone(sources[0], until)
        else:
            backlog.deliver(sources, until)
        return woken

    def deliver_all(self) -> None:
        """Deliver what was received until now, however much it is."""
        self._backlog.deliver_until(time.time_ns(), self._sources)

    def deliver_held(self) -> None:
        """Deliver what was taken and held, at the end: nothing more is taken."""
        self._backlog.deliver_held()

    def close(self) -> None:
        """Free what the watch holds."""
        self._watch.close()
