"""Which subscriptions have messages: the kernel knows, at a cost that does not grow with their number.

An rcl wait set is filled, attached to every reader and taken apart again for each wait. Here DDS writes to an eventfd
of the subscription when a message arrives, and an edge-triggered epoll gives those that were written to.
"""

import os
import select
import time
from collections.abc import Sequence
from contextlib import suppress
from ctypes import c_void_p, cast
from typing import Final

from syncrelay.dataflow.backend import ALL, Ready
from syncrelay.ros.librcl.messages import LibrclSource
from syncrelay.ros.librcl.rcl import Rcl, RclCallError

_NS_PER_SECOND: Final = 1_000_000_000
_EDGE: Final = select.EPOLLIN | select.EPOLLET
_FLAGS: Final = os.EFD_NONBLOCK | os.EFD_CLOEXEC


class EventWatch:
    """Waits for the arrival of messages. Times out to the millisecond, late rather than early."""

    def __init__(self, rcl: Rcl) -> None:
        self._rcl = rcl
        self._notify = cast(rcl.eventfd_write, c_void_p)
        self._epoll = select.epoll()
        self._sources: dict[int, LibrclSource] = {}
        self._wake = os.eventfd(0, _FLAGS)
        self._epoll.register(self._wake, _EDGE)
        self._forced_at = time.time_ns()
        self._woken = False

    def add(self, source: LibrclSource) -> None:
        """Watch one more source; what it has already is found by the next wait. Raises RclCallError."""
        event = os.eventfd(0, _FLAGS)
        self._epoll.register(event, _EDGE)
        self._sources[event] = source
        code = self._rcl.set_on_new_message(source.address, self._notify, event)
        try:
            self._rcl.require(code, "rcl_subscription_set_on_new_message_callback")
        except RclCallError:
            self._forget(event)
            raise
        source.pending = ALL
        os.eventfd_write(event, 1)

    def remove(self, source: LibrclSource) -> None:
        """Watch it no longer; it is to be destroyed next."""
        event = next(event for event, each in self._sources.items() if each is source)
        # Before the number of the eventfd may stand for another file. Whatever librcl says, the source is left: who
        # could no longer be rid of it could not go on.
        with suppress(RclCallError):
            code = self._rcl.set_on_new_message(source.address, None, None)
            self._rcl.require(code, "rcl_subscription_set_on_new_message_callback")
        self._forget(event)

    def _forget(self, event: int) -> None:
        del self._sources[event]
        self._epoll.unregister(event)
        os.close(event)

    def wait(self, timeout_ns: int) -> Ready:
        """Wait until a source gets messages, for the timeout at most, or until a wake."""
        self._woken = False
        ready = self._heard(self._epoll.poll(timeout_ns / _NS_PER_SECOND))
        seen_until = time.time_ns()
        if seen_until - self._forced_at >= _NS_PER_SECOND or seen_until < self._forced_at:
            return self._poll_all(seen_until)
        # What woke us says nothing of the sources that were written to a moment later. That does no harm where it is
        # a single message, as nearly always: DDS has reported what came before, or is about to.
        if len(ready) > 1 or (ready and ready[0].pending > 1):
            ready += [source for source in self._heard(self._epoll.poll(0)) if source not in ready]
        return ready, seen_until, self._woken

    def _heard(self, events: Sequence[tuple[int, int]]) -> list[LibrclSource]:
        """Add to each source the messages that DDS reported."""
        ready = []
        for event, _ in events:
            if (source := self._sources.get(event)) is not None:
                source.pending += os.eventfd_read(event)
                ready.append(source)
            else:
                self._woken = True
        return ready

    def _poll_all(self, now: int) -> Ready:
        """Poll all sources, once a second: an event that was never written must not silence a topic."""
        self._forced_at = now
        for source in self._sources.values():
            source.pending = ALL
        return list(self._sources.values()), now, self._woken

    def wake(self) -> None:
        """Have `wait` return. Any thread."""
        os.eventfd_write(self._wake, 1)

    def close(self) -> None:
        """Leave the sources that are left, and free all files."""
        for source in list(self._sources.values()):
            self.remove(source)
        self._epoll.close()
        os.close(self._wake)
