"""A rest that any thread, and a signal's handler, may end."""

import os
import select
import weakref


class Wakeup:
    """What threading.Event is in all other places.

    A handler runs on the main thread in the midst of anything. In the midst of Event's own `wait` that thread may hold
    the lock that `set` takes, and would wait for itself forever.
    """

    def __init__(self) -> None:
        self._descriptor = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        weakref.finalize(self, os.close, self._descriptor)

    def set(self) -> None:
        """End the rest, or the next one. Any thread, any handler."""
        os.eventfd_write(self._descriptor, 1)

    def wait(self, timeout_s: float | None) -> bool:
        """Rest until `set` is called, or was since the last rest, for so many seconds at most; whether it was.

        None is as long as it takes.
        """
        if not select.select([self._descriptor], [], [], timeout_s)[0]:
            return False
        os.eventfd_read(self._descriptor)
        return True
