"""rclpy's own raw take and publish: payloads are bytes, copied in and out."""

import time
from threading import Event
from typing import Any, Final

from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from syncrelay.cdr import patch_stamp
from syncrelay.dataflow.backend import ALL, BackendName, Deliver, Inbox, PublishError, Ready
from syncrelay.dataflow.deliveries import Tally
from syncrelay.dataflow.flow import Flow
from syncrelay.dataflow.inbox import PolledInbox
from syncrelay.ros.entities import has_subscriber

# rmw_fastrtps takes some triggers of a guard condition for none, one in some ten thousand: they are seen by then.
_LONGEST_NS: Final = 1_000_000_000


class RclpyPayload:
    """One message, in bytes of Python's."""

    __slots__ = ("_content", "received")

    def __init__(self, content: bytes, received: int) -> None:
        self.received = received
        self._content = content

    def content(self) -> bytes:
        """The message's bytes."""
        return self._content


class RclpySource:
    """A subscription drained through rclpy, which does not say whose a message is: see Tally."""

    def __init__(self, subscription: Any, deliver: Deliver) -> None:
        self.deliver = deliver
        self._tally = Tally()
        self.deliveries = self._tally.read
        self.waited = self.pending = 0
        self.handle = subscription.handle
        self._type = subscription.msg_type

    def take(self) -> RclpyPayload | None:
        """Take its oldest message; None if there is none."""
        taken = self.handle.take_message(self._type, True)  # noqa: FBT003  rclpy's signature
        if taken is None:
            self.pending = 0
            return None
        content, info = taken
        received = info["received_timestamp"]
        self._tally.note(None, info["publication_sequence_number"], info["source_timestamp"], received)
        return RclpyPayload(content, received)


class RclpyOutlet:
    """A publisher of bytes."""

    def __init__(self, publisher: Any) -> None:
        self.topic = publisher.topic_name
        self.sent = 0
        self._publisher = publisher

    def send(self, payload: RclpyPayload) -> None:
        """Publish a payload unchanged. Raises PublishError."""
        self.send_content(payload.content())

    def send_stamped(self, payload: RclpyPayload, stamp: int) -> None:
        """Publish a copy of the payload with this stamp."""
        self.send_content(patch_stamp(payload.content(), stamp))

    def send_content(self, content: bytes) -> None:
        """Publish a message that was serialized here. Raises PublishError."""
        try:
            self._publisher.handle.publish_raw(content)
        except _rclpy.RCLError as error:
            raise PublishError(str(error)) from error
        self.sent += 1

    def is_heard(self) -> bool:
        """Whether anyone subscribes; not where rcl cannot tell, of which `send` says why."""
        return has_subscriber(self._publisher)


class WaitSetWatch:
    """Waits on an rcl wait set, in which all sources are named again for every wait."""

    def __init__(self, context: Any) -> None:
        self._context = context
        self._sources: list[RclpySource] = []
        self._wait_set: Any = None
        self._woken = Event()
        self._guard = GuardCondition(callback=None, callback_group=None, context=context)

    def add(self, source: RclpySource) -> None:
        """Watch one more source."""
        self._sources.append(source)
        self._wait_set = None

    def remove(self, source: RclpySource) -> None:
        """Watch it no longer."""
        self._sources.remove(source)
        self._wait_set = None

    def wait(self, timeout_ns: int) -> Ready:
        """Wait until a source has messages, for the timeout or a second at most, or until a wake."""
        if self._wait_set is None:
            self._wait_set = _rclpy.WaitSet(len(self._sources), 1, 0, 0, 0, 0, self._context.handle)
        wait_set = self._wait_set
        # rcl forgets the entities that were not ready.
        wait_set.clear_entities()
        wait_set.add_guard_condition(self._guard.handle)
        for source in self._sources:
            wait_set.add_subscription(source.handle)
        # If messages come for several sources while it waits, it may see only one of them; the next poll sees all.
        seen_until = time.time_ns()
        wait_set.wait(min(timeout_ns, _LONGEST_NS))
        ready = [source for index, source in enumerate(self._sources) if wait_set.is_ready("subscription", index)]
        for source in ready:
            source.pending = ALL
        if woken := self._woken.is_set():
            self._woken.clear()
        return ready, seen_until, woken

    def wake(self) -> None:
        """Have `wait` return. Any thread."""
        self._woken.set()
        self._guard.trigger()

    def close(self) -> None:
        """Free the wait set."""
        self._wait_set = None
        self._guard.destroy()


class NoGraphEvents:
    """rclpy does not report changes of the graph, so there may always be some."""

    def seen(self) -> bool:
        """Whether anything may have changed: always."""
        return True


class RclpyBackend:
    """Takes and publishes bytes through rclpy: what works wherever rclpy does."""

    name = BackendName.RCLPY
    flow = Flow

    def __init__(self, context: Any) -> None:
        self._context = context

    def source(self, subscription: Any, deliver: Deliver) -> RclpySource:
        """Drain a raw rclpy subscription from now on."""
        return RclpySource(subscription, deliver)

    def outlet(self, publisher: Any) -> RclpyOutlet:
        """Publish through an rclpy publisher."""
        return RclpyOutlet(publisher)

    def inbox(self) -> Inbox:
        """Make an inbox, with no sources yet."""
        return PolledInbox(WaitSetWatch(self._context))

    def graph_changes(self, node: Any) -> NoGraphEvents:  # noqa: ARG002  the protocol's signature
        """Follow the graph as a node sees it."""
        return NoGraphEvents()
