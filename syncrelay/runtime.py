"""What the relay takes from the machine beside ROS: clocks, threads, and ways to wait. The simulator has its own."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager
from typing import Any, Final, Protocol

from syncrelay.wakeup import Wakeup


class Rest(Protocol):
    """A rest that any thread may end."""

    def set(self) -> None:
        """End the rest, or the next one. Any thread, any handler of a signal."""
        ...

    def wait(self, timeout_s: float | None) -> bool:
        """Rest until `set` is called, or was since the last rest, for so many seconds at most; whether it was."""
        ...


class Running(Protocol):
    """A thread that was started."""

    def join(self, timeout: float | None = None) -> None:
        """Wait until it has returned, for so many seconds at most."""
        ...

    def is_alive(self) -> bool:
        """Whether it has not returned yet."""
        ...


class Runtime(Protocol):
    """Clocks, threads, locks and futures. Whoever measures a time or waits is given one."""

    def monotonic(self) -> float:
        """Seconds, as time.monotonic()."""
        ...

    def monotonic_ns(self) -> int:
        """Nanoseconds, as time.monotonic_ns()."""
        ...

    def time_ns(self) -> int:
        """Nanoseconds of the system clock, as time.time_ns()."""
        ...

    def thread_time_ns(self) -> int:
        """Nanoseconds for which the calling thread has used a processor, as time.thread_time_ns()."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let other threads run for so long."""
        ...

    def lock(self) -> AbstractContextManager[Any]:
        """Return a new lock, as threading.Lock()."""
        ...

    def rest(self) -> Rest:
        """Return a new rest."""
        ...

    def future(self) -> "Future[Any]":
        """Return a new future, on whose result this runtime's threads can wait."""
        ...

    def start(self, name: str, target: Callable[[], object], *, daemon: bool = False) -> Running:
        """Have a new thread call `target`."""
        ...


class SystemRuntime:
    """This machine's own."""

    def __init__(self) -> None:
        # Bound here once: these are asked for each message.
        self.monotonic = time.monotonic
        self.monotonic_ns = time.monotonic_ns
        self.time_ns = time.time_ns
        self.thread_time_ns = time.thread_time_ns
        self.sleep = time.sleep
        self.lock = threading.Lock
        self.rest = Wakeup

    def future(self) -> "Future[Any]":
        return Future()

    def start(self, name: str, target: Callable[[], object], *, daemon: bool = False) -> threading.Thread:
        thread = threading.Thread(target=target, name=name, daemon=daemon)
        thread.start()
        return thread


SYSTEM: Final[Runtime] = SystemRuntime()
"""The runtime of every process but a simulated one."""
