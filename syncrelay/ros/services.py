"""Services of the relay's node that answer in words: std_srvs/srv/Trigger, which every ROS has."""

from collections.abc import Callable, Generator, Mapping
from concurrent.futures import CancelledError, Future
from threading import Event
from typing import Any, Final, TypeAlias

from rclpy.callback_groups import ReentrantCallbackGroup
from std_srvs.srv import Trigger

from syncrelay.dataflow.bugs import Bugs
from syncrelay.errors import SyncRelayError
from syncrelay.printable import one_entry

Offered: TypeAlias = Mapping[str, Callable[[], "Future[str]"]]
"""What is called for each service, by its name below the node's; the words of its answer come in the future.

A SyncRelayError is an answer too, of a call that did not succeed.
"""

# ROS gives a service a queue of this many answers: if more are sent at once, some are lost.
_MOST_WAITING: Final = 10
_ENDING: Final = "the relay is ending"
# How long an end may take to answer the callers that still wait.
_TELL_S: Final = 1.0


class Services:
    """Offers services on a node until `end`. They are called on the thread of its executor, and none holds it up."""

    def __init__(self, node: Any, offered: Offered, *, bugs: Bugs) -> None:
        self._node = node
        self._bugs = bugs
        self._waiting = 0
        self._nobody_waits = Event()
        self._nobody_waits.set()
        self._ended = False
        # A call that waits for its answer must not block others, nor those for parameters.
        self._group = ReentrantCallbackGroup()
        for name, function in offered.items():
            self._offer(name, function)

    def end(self) -> None:
        """Answer all callers, waiting and new, that the relay is ending. On another thread than the executor's."""
        self._ended = True
        self._node.executor.wake()
        self._nobody_waits.wait(_TELL_S)

    def _offer(self, name: str, function: Callable[[], "Future[str]"]) -> None:
        # rclpy waits only for what was made by `async def`.
        async def answer(_: Any, response: Any) -> Any:
            response.success, text = await self._answer(name, function)
            response.message = one_entry(text)
            return response

        self._node.create_service(Trigger, f"~/{name}", answer, callback_group=self._group)

    async def _answer(self, name: str, function: Callable[[], "Future[str]"]) -> tuple[bool, str]:
        if self._waiting >= _MOST_WAITING:
            return False, f"{_MOST_WAITING} calls are already waiting for their answers; call again later"
        self._waiting += 1
        self._nobody_waits.clear()
        try:
            future = function()
            future.add_done_callback(lambda _: self._node.executor.wake())
            return True, await _Answered(future, lambda: self._ended)
        except CancelledError:
            return False, _ENDING
        except SyncRelayError as error:
            return False, str(error)
        except Exception as error:  # noqa: BLE001  a caller gets an answer whatever happens
            self._bugs.log(f"answering ~/{name}", error)
            return False, f"a bug in syncrelay while answering ~/{name}: {error!r}; its traceback is in the log"
        finally:
            self._waiting -= 1
            if not self._waiting:
                self._nobody_waits.set()


class _Answered:
    """Waits for a future of another thread as rclpy does for its own: it is polled whenever the executor wakes."""

    def __init__(self, future: "Future[str]", has_ended: Callable[[], bool]) -> None:
        self._future = future
        self._has_ended = has_ended

    def __await__(self) -> Generator[None, None, str]:
        while not self._future.done():
            if self._has_ended():
                raise CancelledError
            yield
        return self._future.result()
