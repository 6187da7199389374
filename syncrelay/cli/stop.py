"""SIGINT and SIGTERM as a request to end in order. Imports nothing slow: it must be there before all else."""

import signal
from collections.abc import Callable
from types import FrameType


class StopRequest:
    """Remembers that the process was asked to end.

    A signal that arrives while modules are still being imported would kill the process, or be lost where it is
    PID 1; so this is installed first, and asked between the steps of the start.
    """

    def __init__(self) -> None:
        self.requested = False
        self._wake: Callable[[], None] | None = None

    def install(self) -> None:
        """Take SIGINT and SIGTERM from here on."""
        signal.signal(signal.SIGINT, self._request)
        signal.signal(signal.SIGTERM, self._request)

    def wake_with(self, wake: Callable[[], None]) -> None:
        """Have `wake` called when the request comes, at once if it has come already."""
        self._wake = wake
        if self.requested:
            wake()

    def _request(self, _signal: int, _frame: FrameType | None) -> None:
        self.requested = True
        if self._wake is not None:
            self._wake()
