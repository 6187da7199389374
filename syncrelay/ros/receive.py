"""The receive loop: one thread that takes every message as bytes and hands it on, in the order of arrival.

rclpy's executors rebuild their wait set for every callback, which is most of the cost of a small message.
Here a wake drains all subscriptions that are ready.
"""

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from syncrelay.ros.backlog import Backlog, Subscription

_Result = TypeVar("_Result")

# With a heartbeat, an idle loop turns as often as this.
_BEAT_NS = 1_000_000_000


class ReceiveLoop:
    """Drains raw subscriptions on the thread that calls `run`.

    Only `call` and `stop` may be used from other threads. `deadline` says when `expire` wants to be called
    next, by the clock of `now`, in nanoseconds; None for never. `beat` is called at every turn, at least once
    a second; without it an idle loop sleeps until something comes.
    """

    def __init__(
        self,
        context: Any,
        *,
        now: Callable[[], int],
        deadline: Callable[[], int | None],
        expire: Callable[[int], None],
        beat: Callable[[], None] | None = None,
    ) -> None:
        self._context = context
        self._now = now
        self._deadline = deadline
        self._expire = expire
        self._beat = beat
        self._subscriptions: list[Subscription] = []
        self._backlog = Backlog()
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

    def longest_wait(self) -> int:
        """How long a message at most has waited since this was last asked, in nanoseconds. On the loop's thread."""
        waited, self._backlog.longest_wait = self._backlog.longest_wait, 0
        return waited

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
        """Take what a subscription has, then stop draining it: it may be destroyed. On the loop's thread."""
        self._backlog.deliver(self._subscriptions, seen_until=time.time_ns())
        self._backlog.forget(subscription)
        self._replace_all([kept for kept in self._subscriptions if kept.subscription is not subscription])

    def _replace_all(self, subscriptions: list[Subscription]) -> None:
        self._subscriptions = subscriptions
        self._wait_set = None

    def run(self) -> None:
        """Receive until `stop` is called."""
        try:
            while not self._stopping:
                self._carry_out_calls()
                asked_at = time.time_ns()
                self._backlog.deliver(self._wait(), seen_until=asked_at)
                self._expire_due()
                if self._beat is not None:
                    self._beat()
            self._backlog.deliver_all(self._subscriptions, until=time.time_ns())
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
        """Nanoseconds until the next deadline, none while messages are held; negative waits for ever."""
        if self._backlog:
            return 0
        deadline = self._deadline()
        longest = -1 if self._beat is None else _BEAT_NS
        if deadline is None:
            return longest
        left = max(0, deadline - self._now())
        return left if self._beat is None else min(left, longest)
