"""SIGINT and SIGTERM ask a relay for an orderly end, SIGHUP to read the file again; SIGTERM ends other commands.

Imports nothing slow: the signals must be in hand before anything else is imported.
"""

import os
import signal
import sys
import time
from collections.abc import Callable
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
# Of `struct sigaction` in Linux's C libraries: its size at most, where its flags stand, and one of them.
_ACTION_BYTES = 256
_FLAGS_AT = 8 + 128
_SA_RESETHAND = 0x80000000
# What a shell says of a process that a signal ended, added to the signal's number.
_ENDED_BY = 128
TERMINATED = _ENDED_BY + signal.SIGTERM
"""The exit code of a command that SIGTERM ended."""

# `systemctl stop` and `timeout` signal all processes of a launch, and launch then signals its nodes once more, which it
# also does after Ctrl-C where it has no terminal: what comes within a second is one request.
_ONE_REQUEST_S = 1.0


def release_signals() -> None:
    """Unblock SIGINT and SIGTERM; those that were held back arrive now.

    The image's entry point blocks them: PID 1 would lose what comes before Python has a handler.
    """
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)


class Terminated(BaseException):
    """SIGTERM came, and work is undone. No Exception: what catches those is not to swallow it."""


class Termination:
    """Has SIGTERM end a command that ends by itself, with what it has begun cleared away; a context manager.

    A second SIGTERM ends the process at once.
    """

    def __init__(self) -> None:
        self.came = False
        """Also where what was raised did not get through, as out of a library's callback."""

    def __enter__(self) -> "Termination":  # noqa: PYI034  typing is not imported before the signals are in hand
        self._former = signal.signal(signal.SIGTERM, self._end)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_error: object) -> bool:
        signal.signal(signal.SIGTERM, self._former)
        return kind is Terminated

    def _end(self, number: int, _frame: FrameType | None) -> None:
        if self.came:
            os._exit(_ENDED_BY + number)
        self.came = True
        raise Terminated


class StopRequest:
    """A request to end: until `defer` it ends the process at once, from then on it is remembered.

    A second SIGINT or SIGTERM ends the process at once, whatever hangs by then. From `wake_with` on, when there is
    something to end in order, only one that comes more than a second after the first.

    A signal that arrives while modules are still being imported would kill the process, or be lost where it is
    PID 1: so this is installed before they are.
    """

    def __init__(self) -> None:
        self.requested = False
        self._reload = False
        self._had_terminal = False
        self._wake: Callable[[], None] | None = None
        self._deferred = False
        self._signalled = False

    def install(self) -> None:
        """Handle the signals from here on."""
        self._had_terminal = os.isatty(sys.stderr.fileno())
        for number in _SIGNALS:
            signal.signal(number, self._request)
        signal.signal(signal.SIGHUP, self._request_reload)
        for number in _SIGNALS:
            _take_once(number)
        self._count_on_a_thread()

    def defer(self) -> None:
        """Only remember the request from here on: there is now something to end in order."""
        self._deferred = True

    def wake_with(self, wake: Callable[[], None]) -> None:
        """Call `wake` when the request comes, at once if it has come already."""
        self._wake = wake
        if self.requested:
            wake()
            return
        for number in _SIGNALS:
            # No longer taken once: the second must find its handler, however soon it comes.
            signal.signal(number, self._request)

    def take_reload(self) -> bool:
        """Whether a reload was requested since this was last called."""
        asked, self._reload = self._reload, False
        return asked

    def _request_reload(self, _signal: int, _frame: FrameType | None) -> None:
        if self._had_terminal and not os.isatty(sys.stderr.fileno()):
            # Not asked for: the terminal is gone, and with it whoever could end us.
            self._stop()
            return
        self._reload = True
        if self._wake is not None:
            self._wake()

    def _request(self, number: int, _frame: FrameType | None) -> None:
        if self._signalled:
            if self._wake is None:
                os._exit(_ENDED_BY + number)
            return
        self._signalled = True
        if self._wake is None and os.getpid() != 1:
            # The kernel needs no turn of this thread for it. Of PID 1 it takes no signal that has no handler.
            for each in _SIGNALS:
                signal.signal(each, signal.SIG_DFL)
        self._stop()

    def _stop(self) -> None:
        self.requested = True
        # There is nothing to read again; and as it ends, Python would let the signal kill the process.
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        if self._wake is not None:
            self._wake()
        elif not self._deferred:
            os.write(2, b"syncrelay: stopped before it started\n")
            # No exception: raised in the middle of an import, it could be swallowed there.
            os._exit(0)

    def _count_on_a_thread(self) -> None:
        """Let a second signal of another kind end the process too while Python cannot run the handlers."""
        import threading

        received, told = os.pipe()
        os.set_blocking(told, False)
        signal.set_wakeup_fd(told, warn_on_full_buffer=False)
        threading.Thread(
            target=self._end_at_the_second, args=(received, told), daemon=True, name="syncrelay-signals"
        ).start()

    def _end_at_the_second(self, received: int, told: int) -> None:
        second = _requests(received)[1:]
        if self._wake is not None:
            _pass_over_what_comes_in_a_second(received, told)
            second = []
        for number in second or _requests(received):
            if os.getpid() == 1:
                os._exit(_ENDED_BY + number)
            # It has no handler any more.
            os.kill(os.getpid(), number)


def _requests(received: int) -> list[int]:
    """Wait for signals that ask for an end."""
    while True:
        if found := [number for number in os.read(received, 64) if number in _SIGNALS]:
            return found


def _pass_over_what_comes_in_a_second(received: int, told: int) -> None:
    for number in _SIGNALS:
        # Should all of Python hang before that second is over, the third is the end.
        _take_once(number)
    time.sleep(_ONE_REQUEST_S)
    # Not to wait where nothing came.
    os.write(told, b"\0")
    os.read(received, 64)
    for number in _SIGNALS:
        _leave_to_the_kernel(number)


def _leave_to_the_kernel(number: int) -> None:
    """As SIG_DFL, on any thread: the signal ends the process. Of PID 1 the kernel takes none that has no handler."""
    if os.getpid() == 1:
        return
    import ctypes

    ctypes.CDLL(None).signal(number, None)


def _take_once(number: int) -> None:
    """Let the kernel itself end the process at the second signal, in case Python never gets to run the handler.

    It only does when this thread next runs Python: not while a call into DDS or a file system hangs.
    """
    if os.getpid() == 1:
        return
    import ctypes

    sigaction = ctypes.CDLL(None).sigaction
    action = ctypes.create_string_buffer(_ACTION_BYTES)
    sigaction(number, None, action)
    ctypes.c_uint.from_buffer(action, _FLAGS_AT).value |= _SA_RESETHAND
    sigaction(number, action, None)
