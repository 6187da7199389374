"""The receive loop: one thread that takes every message as bytes and hands it on, in the order of arrival.

rclpy's executors rebuild their wait set for every callback, which is most of the cost of a small message.
Here a wake drains all subscriptions that are ready.
"""

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from heapq import heapify, heappop, heapreplace
from typing import Any, NamedTuple, TypeAlias, TypeVar

from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

Deliver: TypeAlias = Callable[[bytes, int], None]
"""Takes a payload and the time DDS received it, in nanoseconds of the system clock."""

_Result = TypeVar("_Result")

# A wake hands on this many messages before it looks for others, deadlines and calls again.
_TURN = 64
# At the end this many turns are taken, enough for the history of `qos: auto`: what had arrived is not lost.
_LAST_TURNS = 16


class Subscription(NamedTuple):
    """What the loop drains: an rclpy subscription, and where its payloads go."""

    subscription: Any
    deliver: Deliver


class ReceiveLoop:
    """Drains raw subscriptions on the thread that calls `run`.

    Only `call` and `stop` may be used from other threads. `deadline` says when `expire` wants to be called
    next, by the clock of `now`, in nanoseconds; None for never.
    """

    def __init__(
        self,
        context: Any,
        *,
        now: Callable[[], int],
        deadline: Callable[[], int | None],
        expire: Callable[[int], None],
    ) -> None:
        self._context = context
        self._now = now
        self._deadline = deadline
        self._expire = expire
        self._subscriptions: list[Subscription] = []
        self._wait_set: Any = None
        self._guard = GuardCondition(callback=None, callback_group=None, context=context)
        self._calls: deque[tuple[Future[Any], Callable[[], None]]] = deque()
        self._stopping = False
        self._ended = False

    def call(self, function: Callable[[], _Result]) -> "Future[_Result]":
        """Have `function` called between two messages on the loop's thread; its result comes in the future.

        A call that the loop ends before is cancelled.
        """
        future: Future[_Result] = Future()

        def perform() -> None:
            try:
                result = function()
            except BaseException as error:  # noqa: BLE001  it is raised where the result is asked for
                future.set_exception(error)
            else:
                future.set_result(result)

        self._calls.append((future, perform))
        if self._ended:
            self._cancel_calls()
        else:
            self.wake()
        return future

    def wake(self) -> None:
        """Have the loop look at its calls and deadlines now."""
        self._guard.trigger()

    def stop(self) -> None:
        """Have `run` take what has arrived, carry out the calls still due, and return."""
        self._stopping = True
        self.wake()

    def add(self, subscription: Subscription) -> None:
        """Drain one more subscription. On the loop's thread, or before it runs."""
        self._replace_all([*self._subscriptions, subscription])

    def remove(self, subscription: Any) -> None:
        """Stop draining an rclpy subscription, which may be destroyed then. On the loop's thread."""
        self._replace_all([kept for kept in self._subscriptions if kept.subscription is not subscription])

    def _replace_all(self, subscriptions: list[Subscription]) -> None:
        self._subscriptions = subscriptions
        self._wait_set = None

    def run(self) -> None:
        """Receive until `stop` is called."""
        try:
            while not self._stopping:
                self._carry_out_calls()
                self._drain(self._wait())
                self._expire_due()
            for _ in range(_LAST_TURNS):
                self._drain(self._subscriptions)
            self._carry_out_calls()
        finally:
            self._ended = True
            self._cancel_calls()

    def close(self) -> None:
        """Free what the loop holds of rcl. After `run` has returned."""
        self._wait_set = None
        self._guard.destroy()

    def _carry_out_calls(self) -> None:
        while self._calls:
            self._calls.popleft()[1]()

    def _cancel_calls(self) -> None:
        while self._calls:
            self._calls.popleft()[0].cancel()

    def _expire_due(self) -> None:
        deadline = self._deadline()
        if deadline is not None and (now := self._now()) >= deadline:
            self._expire(now)

    def _wait(self) -> list[Subscription]:
        """Sleep until something is there; the subscriptions that are ready."""
        if self._wait_set is None:
            self._wait_set = _rclpy.WaitSet(len(self._subscriptions), 1, 0, 0, 0, 0, self._context.handle)
        wait_set = self._wait_set
        # rcl forgets the entities that were not ready, so all are named again for every wait.
        wait_set.clear_entities()
        wait_set.add_guard_condition(self._guard.handle)
        for subscription in self._subscriptions:
            wait_set.add_subscription(subscription.subscription.handle)
        wait_set.wait(self._timeout())
        return [
            subscription
            for index, subscription in enumerate(self._subscriptions)
            if wait_set.is_ready("subscription", index)
        ]

    def _timeout(self) -> int:
        """Nanoseconds until the next deadline; negative waits for ever."""
        deadline = self._deadline()
        return -1 if deadline is None else max(0, deadline - self._now())

    def _drain(self, ready: Sequence[Subscription]) -> None:
        """Hand on what has arrived, in the order of arrival over all subscriptions.

        DDS keeps order within a topic only. Drained one after the other, a backlog of a fast topic would
        overflow its queues before the slow topic's messages of the same time are seen.
        """
        heads = [head for index, each in enumerate(ready) if (head := _take(each, index)) is not None]
        heapify(heads)
        left = _TURN
        while heads:
            received, index, payload = heads[0]
            following = _take(ready[index], index) if left > 0 else None
            left -= 1
            if following is None:
                heappop(heads)
            else:
                heapreplace(heads, following)
            ready[index].deliver(payload, received)


def _take(subscription: Subscription, index: int) -> tuple[int, int, bytes] | None:
    """The next message: when DDS received it, the subscription's place, the payload."""
    taken = subscription.subscription.handle.take_message(subscription.subscription.msg_type, True)  # noqa: FBT003
    if taken is None:
        return None
    payload, meta = taken
    return meta["received_timestamp"], index, payload
