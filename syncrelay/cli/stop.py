"""SIGINT and SIGTERM as a request to end in order, SIGHUP as one to read the file again.

Imports nothing slow: it must be there before all else.
"""

import os
import signal
import sys
from collections.abc import Callable
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def release_signals() -> None:
    """Let SIGINT and SIGTERM come, with those that were held back until now.

    The image's entry point blocks them: PID 1 would lose what comes before Python has a handler.
    """
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)


class StopRequest:
    """Ends the process at once while there is nothing to lose, and is remembered from `defer` on.

    A signal that arrives while modules are still being imported would kill the process, or be lost where it is
    PID 1: so this is installed before they are.
    """

    def __init__(self) -> None:
        self.requested = False
        self._reload = False
        self._had_terminal = os.isatty(sys.stderr.fileno())
        self._wake: Callable[[], None] | None = None
        self._deferred = False

    def install(self) -> None:
        """Take the signals from here on."""
        for number in _SIGNALS:
            signal.signal(number, self._request)
        signal.signal(signal.SIGHUP, self._request_reload)

    def defer(self) -> None:
        """From here on there is something to end in order: only remember the request."""
        self._deferred = True

    def wake_with(self, wake: Callable[[], None]) -> None:
        """Have `wake` called when the request comes, at once if it has come already."""
        self._wake = wake
        if self.requested:
            wake()

    def take_reload(self) -> bool:
        """Whether the file is to be read again, since this was last asked."""
        asked, self._reload = self._reload, False
        return asked

    def _request_reload(self, signal_number: int, frame: FrameType | None) -> None:
        if self._had_terminal and not os.isatty(sys.stderr.fileno()):
            # Not asked for: the terminal is gone, and with it whoever could end us.
            self._request(signal_number, frame)
            return
        self._reload = True
        if self._wake is not None:
            self._wake()

    def _request(self, _signal: int, _frame: FrameType | None) -> None:
        self.requested = True
        # There is nothing to read again; and as it ends, Python would let the signal kill the process.
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        if self._wake is not None:
            self._wake()
        elif not self._deferred:
            os.write(2, b"syncrelay: stopped before it started\n")
            # No exception: raised in the middle of an import, it could be swallowed there.
            os._exit(0)
