"""Functions that one thread has another call."""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeVar

from syncrelay.runtime import SYSTEM, Runtime

if TYPE_CHECKING:
    from concurrent.futures import Future

_Result = TypeVar("_Result")


class Calls:
    """Functions to be called on one thread, in the order in which other threads asked for it.

    `wake` is called on the asking thread when there is something to carry out.
    """

    def __init__(self, wake: Callable[[], None], *, runtime: Runtime = SYSTEM) -> None:
        self._wake = wake
        self._future = runtime.future
        self._due: deque[tuple[Future[Any], Callable[[], None]]] = deque()
        self._ended = False

    def __bool__(self) -> bool:
        return bool(self._due)

    def add(self, function: Callable[[], _Result]) -> "Future[_Result]":
        """Have `function` called; its result, or what it raised, comes in the future. Any thread.

        A call is cancelled if the end comes before it is carried out, or has come already.
        """
        future: Future[_Result] = self._future()

        def perform() -> None:
            try:
                result = function()
            except BaseException as error:  # noqa: BLE001  it is raised where the result is asked for
                future.set_exception(error)
            else:
                future.set_result(result)

        self._due.append((future, perform))
        if self._ended:
            self.end()
        else:
            self._wake()
        return future

    def carry_out(self) -> None:
        """Call what is due."""
        while self._due:
            self._due.popleft()[1]()

    def end(self) -> None:
        """Cancel the calls that are due, and all later ones."""
        self._ended = True
        # A thread that asks after the end cancels too, perhaps at the same moment.
        with suppress(IndexError):
            while True:
                self._due.popleft()[0].cancel()
