"""Messages taken and published from where they lie."""

from ctypes import byref
from typing import Any, Final

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from syncrelay.cdr import STAMP_BYTES, write_stamp
from syncrelay.dataflow.backend import Deliver, PublishError
from syncrelay.ros.librcl.buffers import OwnMessage, Payload, Pool
from syncrelay.ros.librcl.rcl import NOTHING_TAKEN, MessageInfo, Rcl, RclCallError, pointer


class LibrclSource:
    """A subscription drained by librcl."""

    def __init__(self, rcl: Rcl, pool: Pool, subscription: Any, deliver: Deliver) -> None:
        self.deliver = deliver
        self.waited = 0
        self.pending = 0
        """How many messages DDS has reported: asking librcl once more costs nearly as much as a message."""
        self._pool = pool
        self.address: Final[int] = subscription.handle.pointer
        # It owns what the address points to.
        self._subscription = subscription
        self._pointer = pointer(self.address)
        self._rcl = rcl
        self._call = rcl.take
        self._info = MessageInfo()
        self._info_pointer = byref(self._info)
        self._spare = pool.spare
        self._next = pool.make()

    def take(self) -> Payload | None:
        """Take its oldest message; None if there is none after all. Raises RclCallError."""
        memory = self._next
        code = self._call(self._pointer, memory.pointer, self._info_pointer, None)
        if code:
            if code != NOTHING_TAKEN:
                self._rcl.require(code, "rcl_take_serialized_message")
            # A full history has replaced some of those that were pending.
            self.pending = 0
            return None
        self.pending -= 1
        self._next = self._spare.pop() if self._spare else self._pool.make()
        return Payload(memory, self._pool, self._info.received_timestamp)


class LibrclOutlet:
    """A publisher that librcl sends through."""

    def __init__(self, rcl: Rcl, publisher: Any) -> None:
        self._rcl = rcl
        self._call = rcl.publish
        self.topic: str = publisher.topic_name
        self.sent = 0
        self._count_subscriptions = publisher.handle.get_subscription_count
        self._own = OwnMessage(rcl)
        # It owns what the address points to.
        self._publisher = publisher
        self._pointer = pointer(publisher.handle.pointer)

    def send(self, payload: Payload) -> None:
        """Publish a payload unchanged. Raises PublishError."""
        code = self._call(self._pointer, payload.memory.pointer, None)
        if code:
            self._fail(code)
        self.sent += 1

    def send_stamped(self, payload: Payload, stamp: int) -> None:
        """Publish a payload with this stamp, and put its own back: another set may hold it too."""
        content = payload.content()
        own = bytes(content[STAMP_BYTES])
        write_stamp(content, stamp)
        try:
            self.send(payload)
        finally:
            content[STAMP_BYTES] = own

    def send_content(self, content: bytes) -> None:
        """Publish a message that was serialized here. Raises PublishError."""
        self._own.fill(content)
        code = self._call(self._pointer, self._own.pointer, None)
        if code:
            self._fail(code)
        self.sent += 1

    def is_heard(self) -> bool:
        """Whether anyone subscribes; not where rcl cannot tell, of which `send` says why."""
        try:
            return bool(self._count_subscriptions())
        except _rclpy.RCLError:
            return False

    def _fail(self, code: int) -> None:
        try:
            self._rcl.require(code, "rcl_publish_serialized_message")
        except RclCallError as error:
            raise PublishError(str(error)) from error
