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
# `struct sigaction` of Linux's C libraries: an upper bound of its size, the offset of its flags, and one of the flags.
_ACTION_BYTES = 256
_FLAGS_AT = 8 + 128
_SA_RESETHAND = 0x80000000
# A shell adds this to a signal's number for the exit code of a process that the signal ended.
_ENDED_BY = 128
TERMINATED = _ENDED_BY + signal.SIGTERM
"""The exit code of a command that SIGTERM ended."""

# `systemctl stop` and `timeout` signal all processes of a launch, and launch then signals its nodes again; it does so
# after Ctrl-C too where it has no terminal. Signals within one second count as one request.
_ONE_REQUEST_S = 1.0


def release_signals() -> None:
    """Unblock SIGINT and SIGTERM; signals that were held back arrive now.

    The image's entry point blocks them, because PID 1 loses signals that arrive before it has a handler.
    """
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)


class Terminated(BaseException):
    """SIGTERM came before the work was done. Not an Exception, so that `except Exception` does not swallow it."""


class Termination:
    """Raises Terminated at SIGTERM, so that a command that ends by itself cleans up first; a context manager.

    A second SIGTERM ends the process at once.
    """

    def __init__(self) -> None:
        self.came = False
        """Whether SIGTERM came, even if Terminated was lost, as in a callback of a library."""

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
    """A request to end. Before `defer` it ends the process at once; afterwards it is remembered.

    A second SIGINT or SIGTERM ends the process at once, whatever hangs. After `wake_with`, when there is something to
    end in order, it does so only if it comes more than a second after the first.

    It is installed before other modules are imported: a signal during the imports would kill the process, or be lost
    if that is PID 1.
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
        """Remember requests from here on, as there is now something to end in order."""
        self._deferred = True

    def wake_with(self, wake: Callable[[], None]) -> None:
        """Call `wake` when the request comes, at once if it has come already."""
        self._wake = wake
        if self.requested:
            wake()
            return
        for number in _SIGNALS:
            # Installed again without SA_RESETHAND: a second signal must find its handler, however soon it comes.
            signal.signal(number, self._request)

    def take_reload(self) -> bool:
        """Whether a reload was requested since this was last called."""
        asked, self._reload = self._reload, False
        return asked

    def _request_reload(self, _signal: int, _frame: FrameType | None) -> None:
        if self._had_terminal and not os.isatty(sys.stderr.fileno()):
            # This SIGHUP comes from a closed terminal. It asks for no reload, and nobody is left to end the relay.
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
            # The kernel then acts on the second signal without this thread. PID 1 ignores signals without a handler.
            for each in _SIGNALS:
                signal.signal(each, signal.SIG_DFL)
        self._stop()

    def _stop(self) -> None:
        self.requested = True
        # A reload would be in vain, and during its exit Python would let SIGHUP kill the process.
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        if self._wake is not None:
            self._wake()
        elif not self._deferred:
            os.write(2, b"syncrelay: stopped before it started\n")
            # An exception could be swallowed by an import that is under way.
            os._exit(0)

    def _count_on_a_thread(self) -> None:
        """End the process at a second signal of another kind even while Python cannot run the handlers."""
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
            # The first signal removed its handler.
            os.kill(os.getpid(), number)


def _requests(received: int) -> list[int]:
    """Wait for signals that ask for an end."""
    while True:
        if found := [number for number in os.read(received, 64) if number in _SIGNALS]:
            return found


def _pass_over_what_comes_in_a_second(received: int, told: int) -> None:
    for number in _SIGNALS:
        # If all of Python hangs before the second is over, a third signal ends the process.
        _take_once(number)
    time.sleep(_ONE_REQUEST_S)
    # Written so that the read below does not wait if no signal came.
    os.write(told, b"\0")
    os.read(received, 64)
    for number in _SIGNALS:
        _leave_to_the_kernel(number)


def _leave_to_the_kernel(number: int) -> None:
    """Set SIG_DFL from any thread, so that the signal ends the process. PID 1 keeps its handler."""
    if os.getpid() == 1:
        return
    import ctypes

    ctypes.CDLL(None).signal(number, None)


def _take_once(number: int) -> None:
    """Reset the handler at the first signal, so that the kernel ends the process at the second.

    Python runs handlers only when this thread next runs Python code: not while a call into DDS or a file system hangs.
    """
    if os.getpid() == 1:
        return
    import ctypes

    sigaction = ctypes.CDLL(None).sigaction
    action = ctypes.create_string_buffer(_ACTION_BYTES)
    sigaction(number, None, action)
    ctypes.c_uint.from_buffer(action, _FLAGS_AT).value |= _SA_RESETHAND
    sigaction(number, action, None)
