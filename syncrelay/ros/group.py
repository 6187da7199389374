"""One group at work: payloads in, matched sets out on the group's publishers. Lives on the receive thread."""

import time
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from typing import Any, NamedTuple

from syncrelay.config import GroupConfig
from syncrelay.explain import RecentDrop
from syncrelay.ros.path import Outlet
from syncrelay.sync import Drop, DropReason, Match, Message

# Enough for the widest terminal's strip of recent sets.
_RECENT = 256
# What is kept for whoever watches, between two of his looks: at 1 kHz they may be 10 s apart.
_WATCHED = 10_000


class Batch(NamedTuple):
    """What came and left since the last look, oldest first.

    `arrivals` are stamps and times of receipt of each input, `sets` the sets' stamps and their latencies, `keys` what
    the newest messages are matched by; times in nanoseconds.
    """

    arrivals: tuple[deque[tuple[int, int]], ...]
    sets: deque[tuple[tuple[int | None, ...], int]]
    keys: tuple[Hashable, ...]


class GroupRelay:
    """Feeds a group's engine and publishes the sets that it gives."""

    def __init__(self, config: GroupConfig, *, now: Callable[[], int]) -> None:
        self.config = config
        self.engine = config.engine()
        self.last: deque[tuple[int | None, ...] | RecentDrop] = deque(maxlen=_RECENT)
        """What left last, oldest first; of a set the stamps alone, as one is noted for each."""
        self._now = now
        self._n_inputs = len(config.topics)
        self._keys: list[Hashable] = [None] * self._n_inputs
        self._watch()
        self._restamped = [False] * len(config.topics)
        self._outlets: list[Outlet | None] = [None] * len(config.topics)

    def connect(self, index: int, outlet: Outlet, *, restamped: bool) -> None:
        """Publish one input's messages through an outlet from now on.

        `restamped` says that its payloads begin with a Header, whose stamp the set's common stamp replaces.
        """
        self._outlets[index] = outlet
        self._restamped[index] = restamped

    def receive(self, index: int, payload: Any, received: int, stamp: int | None) -> None:
        """Take in a message of one input by its stamp, None where none could be read; times in nanoseconds."""
        if stamp is None:
            self._reject(index, payload, received)
            return
        self._arrivals[index].append((stamp, received))
        self._settle(self.engine.add(Message(index, stamp, (payload, received)), now=self._now()))

    def receive_keyed(self, index: int, payload: Any, received: int, stamp: int | None, key: Hashable) -> None:
        """Take in a message that is matched by its key; None where none could be read."""
        if stamp is None or key is None:
            self._reject(index, payload, received)
            return
        self._arrivals[index].append((stamp, received))
        self._keys[index] = key
        self._settle(self.engine.add(Message(index, stamp, (payload, received), key), now=self._now()))

    def watched(self) -> Batch:
        """Give what came and left since this was last asked for."""
        batch = Batch(self._arrivals, self._sets, tuple(self._keys))
        self._watch()
        return batch

    def _watch(self) -> None:
        self._arrivals = tuple(deque[tuple[int, int]](maxlen=_WATCHED) for _ in range(self._n_inputs))
        self._sets = deque[tuple[tuple[int | None, ...], int]](maxlen=_WATCHED)

    def _reject(self, index: int, payload: Any, received: int) -> None:
        self._settle([self.engine.reject(Message(index, 0, (payload, received)), DropReason.MALFORMED)])

    def expire(self, now: int) -> None:
        """Let go what has waited long enough."""
        self._settle(self.engine.expire(now=now))

    def flush(self, reason: DropReason) -> None:
        """Drop all that is buffered."""
        self._settle(self.engine.flush(reason))

    def _settle(self, outcomes: Sequence[Match | Drop]) -> None:
        for outcome in outcomes:
            if isinstance(outcome, Match):
                newest = self._send(outcome)
                stamps = outcome.stamps
                self._sets.append((stamps, time.time_ns() - newest))
                self.last.append(stamps)
            else:
                message = outcome.message
                self.last.append(RecentDrop(message.input, message.stamp, outcome.reason))

    def _send(self, match: Match) -> int:
        """Publish a set; when its newest message was received."""
        newest = 0
        for message in match.messages:
            if message is None:
                continue
            # As it was fed: what DDS received, and when, in nanoseconds of the system clock.
            payload, received = message.payload
            newest = max(newest, received)
            outlet = self._outlets[message.input]
            if outlet is None:
                continue
            if match.stamp is not None and self._restamped[message.input]:
                outlet.send_stamped(payload, match.stamp)
            else:
                outlet.send(payload)
        return newest
