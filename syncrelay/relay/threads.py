"""The threads of a relay."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from syncrelay.runtime import Running, Runtime

if TYPE_CHECKING:
    from concurrent.futures import Future


class Threads:
    """Threads that are joined together."""

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._all: list[Running] = []

    def start(self, name: str, target: Callable[[], None]) -> "Future[None]":
        """Have a thread of its own call a function; how that ended comes in the future."""
        ended: Future[None] = self._runtime.future()

        def run() -> None:
            try:
                target()
            except BaseException as error:  # noqa: BLE001  it is raised where the result is asked for
                ended.set_exception(error)
            else:
                ended.set_result(None)

        self._all.append(self._runtime.start(f"syncrelay-{name}", run))
        return ended

    def join(self) -> None:
        """Wait until all have ended."""
        for thread in self._all:
            thread.join()
