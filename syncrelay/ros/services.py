"""Services of a node of rclpy that answer in words: std_srvs/srv/Trigger, which every ROS has."""

from collections.abc import Generator
from threading import Event
from typing import TYPE_CHECKING, Any

from rclpy.callback_groups import ReentrantCallbackGroup
from std_srvs.srv import Trigger

from syncrelay.relay.ports import Answer, Call

if TYPE_CHECKING:
    from concurrent.futures import Future


class Answering:
    """Calls back for each request, and sends the answer when there is one."""

    def __init__(self, raw: Any) -> None:
        self._raw = raw
        # A call that waits for its answer must not block others, nor those for parameters.
        self._group = ReentrantCallbackGroup()
        self._waiting = 0
        self._nobody_waits = Event()
        self._nobody_waits.set()

    def offer(self, name: str, call: Call) -> None:
        """Offer a service below the node's name."""

        # rclpy waits only for what was made by `async def`.
        async def answer(_: Any, response: Any) -> Any:
            self._waiting += 1
            self._nobody_waits.clear()
            try:
                response.success, response.message = await self._answered(call)
                return response
            finally:
                self._waiting -= 1
                if not self._waiting:
                    self._nobody_waits.set()

        self._raw.create_service(Trigger, f"~/{name}", answer, callback_group=self._group)

    def flush(self, patience_s: float) -> None:
        """Give answers that are ready so long to be sent."""
        self._nobody_waits.wait(patience_s)

    async def _answered(self, call: Call) -> Answer:
        future = call()
        future.add_done_callback(lambda _: self._raw.executor.wake())
        return await _Awaited(future)


class _Awaited:
    """Waits for a future of another thread as rclpy does for its own: it is polled whenever the executor wakes."""

    def __init__(self, future: "Future[Answer]") -> None:
        self._future = future

    def __await__(self) -> Generator[None, None, Answer]:
        while not self._future.done():
            yield
        return self._future.result()
