"""One group at work: payloads in, matched sets out on the group's publishers. Lives on the receive thread."""

from collections import deque
from collections.abc import Callable, Hashable, Sequence
from typing import Any

from syncrelay.cdr import patch_stamp
from syncrelay.config import GroupConfig
from syncrelay.ros.snapshot import RecentDrop, RecentSet
from syncrelay.sync import Drop, DropReason, Match, Message

# Enough for the widest terminal's strip of recent sets.
_RECENT = 256


class GroupRelay:
    """Feeds a group's engine and publishes the sets that it gives."""

    def __init__(self, config: GroupConfig, *, now: Callable[[], int]) -> None:
        self.config = config
        self.engine = config.engine()
        self.recent: deque[RecentSet | RecentDrop] = deque(maxlen=_RECENT)
        self._now = now
        self._restamped = [False] * len(config.topics)
        self._publish: list[Callable[[bytes], None] | None] = [None] * len(config.topics)

    def connect(self, index: int, publisher: Any, *, restamped: bool) -> None:
        """Publish one input's messages through an rclpy publisher from now on.

        `restamped` says that its payloads begin with a Header, whose stamp the set's common stamp replaces.
        """
        self._publish[index] = publisher.handle.publish_raw
        self._restamped[index] = restamped

    def receive(self, index: int, payload: bytes, stamp: int | None) -> None:
        """Take in a message of one input by its stamp in nanoseconds; None where none could be read."""
        if stamp is None:
            self._reject(index, payload)
        else:
            self._settle(self.engine.add(Message(index, stamp, payload), now=self._now()))

    def receive_keyed(self, index: int, payload: bytes, stamp: int | None, key: Hashable) -> None:
        """Take in a message that is matched by its key; None where none could be read."""
        if stamp is None or key is None:
            self._reject(index, payload)
        else:
            self._settle(self.engine.add(Message(index, stamp, payload, key), now=self._now()))

    def _reject(self, index: int, payload: bytes) -> None:
        self._settle([self.engine.reject(Message(index, 0, payload), DropReason.MALFORMED)])

    def expire(self, now: int) -> None:
        """Let go what has waited long enough."""
        self._settle(self.engine.expire(now=now))

    def flush(self, reason: DropReason) -> None:
        """Drop all that is buffered."""
        self._settle(self.engine.flush(reason))

    def _settle(self, outcomes: Sequence[Match | Drop]) -> None:
        for outcome in outcomes:
            if isinstance(outcome, Match):
                self._send(outcome)
                self.recent.append(RecentSet(tuple(m and m.stamp for m in outcome.messages)))
            else:
                message = outcome.message
                self.recent.append(RecentDrop(message.input, message.stamp, outcome.reason))

    def _send(self, match: Match) -> None:
        for message, publish, restamped in zip(match.messages, self._publish, self._restamped, strict=True):
            if message is None or publish is None:
                continue
            if match.stamp is not None and restamped:
                publish(patch_stamp(message.payload, match.stamp))
            else:
                publish(message.payload)
