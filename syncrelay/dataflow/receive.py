"""The receive loop: one thread that takes every message as bytes and hands it on, in the order of arrival.

rclpy's executors rebuild their wait set for every callback, which is most of the cost of a small message.
Here a wake drains all sources that are ready.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from syncrelay.dataflow.backend import Inbox, Source
from syncrelay.dataflow.calls import Calls
from syncrelay.runtime import SYSTEM, Runtime

if TYPE_CHECKING:
    from concurrent.futures import Future

_Result = TypeVar("_Result")

# An idle loop turns at least this often.
_LONGEST_REST_NS = 1_000_000_000
# A turn that fails and is repeated at once must not take all of a core.
_AFTER_FAILURE_S = 0.01


class ReceiveLoop:
    """Has an inbox deliver messages on the thread that calls `run`.

    Only `call`, `wake`, `stop` and the attributes may be used from other threads. `expire` is called with the time of
    `now`, in nanoseconds, when that is due, and `on_turn` at least once a second. `contain` gets exceptions that
    nothing else caught, and the loop goes on; without it, the loop ends and `run` raises them.
    """

    def __init__(
        self,
        inbox: Inbox,
        *,
        now: Callable[[], int],
        expire: Callable[[int], None],
        deadline: Callable[[], int | None] | None = None,
        on_turn: Callable[[], None] | None = None,
        contain: Callable[[Exception], None] | None = None,
        runtime: Runtime = SYSTEM,
    ) -> None:
        self._inbox = inbox
        self._now = now
        self.deadline = deadline
        """Returns when `expire` is to be called next, by the clock of `now`; None while it never is.

        It is called after every delivery; wake the loop after replacing it.
        """
        self._monotonic = runtime.monotonic
        self._sleep = runtime.sleep
        self.turned = runtime.monotonic()
        """When the loop last turned, by the runtime's monotonic clock: at least once a second while it works."""
        self._expire = expire
        self._on_turn = on_turn
        self._contain = contain
        self._sources: dict[Source, Callable[[Exception], None]] = {}
        self._calls = Calls(inbox.wake, runtime=runtime)
        self._stopping = False

    def call(self, function: Callable[[], _Result]) -> "Future[_Result]":
        """Have `function` called between two messages on the loop's thread; its result comes in the future.

        A call that the loop ends before is cancelled.
        """
        return self._calls.add(function)

    def wake(self) -> None:
        """Have the loop check its calls and deadlines now."""
        self._inbox.wake()

    def stop(self) -> None:
        """Have `run` take what has arrived, carry out the calls still due, and return."""
        self._stopping = True
        self.wake()

    def add(self, source: Source, failed: Callable[[Exception], None]) -> None:
        """Drain one more source. On the loop's thread, or before it runs.

        If it can give no more messages it is removed, and `failed` is called with the error, on the loop's thread.
        """
        self._inbox.add(source)
        self._sources[source] = failed

    def remove(self, source: Source) -> None:
        """Take what a source has, then stop draining it: it may be destroyed. On the loop's thread."""
        self._inbox.deliver_all()
        self._leave(source)

    def _leave(self, source: Source) -> None:
        self._sources.pop(source, None)
        self._inbox.remove(source)

    def run(self) -> None:
        """Receive until `stop` is called."""
        try:
            while not self._stopping:
                self._guarded(self._receive)
                if not self._stopping:
                    self._sleep(_AFTER_FAILURE_S)
            for last in (self._inbox.deliver_all, self._inbox.deliver_held, self._calls.carry_out):
                self._guarded(last)
        finally:
            self._calls.end()

    def _guarded(self, function: Callable[[], None]) -> None:
        try:
            function()
        except Exception as error:
            if self._contain is None:
                raise
            self._contain(error)

    def _receive(self) -> None:
        while not self._stopping:
            if self._calls:
                self._calls.carry_out()
            deadline = self.deadline
            if deadline is None:
                self._inbox.receive(_LONGEST_REST_NS)
            else:
                self._inbox.receive_once(self._expire_due(deadline))
            if self._inbox.failed:
                self._end_failed()
            self.turned = self._monotonic()
            if self._on_turn is not None:
                self._on_turn()

    def _end_failed(self) -> None:
        """Stop draining what failed, and pass the error to who added it."""
        for source, error in dict(self._inbox.failed).items():
            failed_of = self._sources.get(source)
            self._leave(source)
            if failed_of is not None:
                failed_of(error)

    def close(self) -> None:
        """Free what the loop holds of rcl. After `run` has returned."""
        self._inbox.close()

    def _expire_due(self, deadline: Callable[[], int | None]) -> int:
        """Call `expire` if it is due, and return the nanoseconds until the next deadline, at most a second."""
        due, now = deadline(), self._now()
        if due is not None and now >= due:
            self._expire(now)
            due, now = deadline(), self._now()
        return _LONGEST_REST_NS if due is None else min(max(0, due - now), _LONGEST_REST_NS)
