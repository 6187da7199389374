"""Messages of many subscriptions in the order in which they arrived.

DDS keeps order within a topic only. Drained one topic after the other, a backlog of a fast topic would overflow its
queues before a slow topic's messages of the same time are seen.
"""

import time
from collections.abc import Callable, Iterable
from heapq import heappop, heappush
from itertools import count
from typing import Any, NamedTuple, TypeAlias

Deliver: TypeAlias = Callable[[bytes, int], None]
"""Takes a payload and the time DDS received it, in nanoseconds of the system clock."""


class Subscription(NamedTuple):
    """An rclpy subscription, and where its payloads go."""

    subscription: Any
    deliver: Deliver


_Head: TypeAlias = tuple[int, int, bytes, Subscription]


class Backlog:
    """Takes messages and delivers them, the oldest first; at most one of each subscription is held between calls."""

    def __init__(self) -> None:
        self.longest_wait = 0
        """How long a message at most has waited since DDS received it, in nanoseconds; the reader sets it back."""
        self._heads: list[_Head] = []
        self._held: set[int] = set()
        self._ties = count()

    def __bool__(self) -> bool:
        return bool(self._heads)

    def deliver(self, ready: Iterable[Subscription], *, seen_until: int) -> None:
        """Deliver what is certain to be the oldest.

        `ready` were found to have messages by a look that saw all that was received up to `seen_until`, in
        nanoseconds of the system clock. What came later is held: an older message may lie in a subscription
        that had none at the time of the look.
        """
        for subscription in ready:
            if id(subscription.subscription) not in self._held:
                self._take(subscription)
        if self._heads:
            self.longest_wait = max(self.longest_wait, time.time_ns() - self._heads[0][0])
        # The look saw the newest of these, hence all that came before it too.
        newest = max((head[0] for head in self._heads), default=0)
        self._deliver_until(max(newest, seen_until))

    def deliver_all(self, subscriptions: Iterable[Subscription], *, until: int) -> None:
        """Deliver what was received up to `until`, and what is held."""
        self.deliver(subscriptions, seen_until=until)
        while self._heads:
            self._pop()

    def forget(self, subscription: Any) -> None:
        """Deliver what is held of a subscription that ends."""
        if id(subscription) in self._held:
            head = next(head for head in self._heads if head[3].subscription is subscription)
            self._heads.remove(head)
            self._heads.sort()
            self._hand_on(head)

    def _deliver_until(self, limit: int) -> None:
        while self._heads and self._heads[0][0] <= limit:
            subscription = self._pop()
            self._take(subscription)

    def _pop(self) -> Subscription:
        return self._hand_on(heappop(self._heads))

    def _hand_on(self, head: _Head) -> Subscription:
        received, _, payload, subscription = head
        self._held.discard(id(subscription.subscription))
        subscription.deliver(payload, received)
        return subscription

    def _take(self, subscription: Subscription) -> None:
        taken = subscription.subscription.handle.take_message(subscription.subscription.msg_type, True)  # noqa: FBT003
        if taken is not None:
            payload, meta = taken
            self._held.add(id(subscription.subscription))
            heappush(self._heads, (meta["received_timestamp"], next(self._ties), payload, subscription))
