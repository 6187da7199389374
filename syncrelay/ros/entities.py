"""Subscriptions and publishers of rclpy."""

from typing import Any

from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from syncrelay.relay.ports import RclError


class RosSubscription:
    """A raw subscription of rclpy, which a backend drains."""

    def __init__(self, raw: Any) -> None:
        """Raise RCLError where rcl cannot count what is lost."""
        self.raw, self.handle, self.msg_type = raw, raw.handle, raw.msg_type
        self._losses = _loss_counter(raw)

    @property
    def topic_name(self) -> str:
        return str(self.raw.topic_name)

    def lost(self) -> int:
        return int(self._losses.take_event().total_count) if self._losses is not None else 0

    def release(self) -> None:
        """Let go what would keep the subscription alive."""
        self._losses = self.handle = None


def _loss_counter(raw: Any) -> Any:
    """Return what counts the messages that DDS loses, None where DDS does not count them. Raises RCLError."""
    try:
        return _rclpy.EventHandle(raw.handle, _rclpy.rcl_subscription_event_type_t.RCL_SUBSCRIPTION_MESSAGE_LOST)
    except _rclpy.UnsupportedEventTypeError:
        return None


class RosPublisher:
    """A publisher of rclpy."""

    def __init__(self, raw: Any) -> None:
        self.raw, self.handle, self.msg_type = raw, raw.handle, raw.msg_type

    @property
    def topic_name(self) -> str:
        return str(self.raw.topic_name)

    def publish(self, message: Any) -> None:
        try:
            self.raw.publish(message)
        except _rclpy.RCLError as error:
            raise RclError(str(error)) from error

    def is_heard(self) -> bool:
        return has_subscriber(self)

    def wait_until_acknowledged(self, patience_ns: int) -> None:
        self.raw.wait_for_all_acked(Duration(nanoseconds=patience_ns))

    def release(self) -> None:
        """Let go what would keep the publisher alive."""
        self.handle = None


def has_subscriber(publisher: Any) -> bool:
    """Whether anyone subscribes to what a publisher of rclpy publishes; False where rcl cannot tell."""
    try:
        return bool(publisher.handle.get_subscription_count())
    except _rclpy.RCLError:
        return False


def never_called(_: bytes) -> None:
    """Fill the place of the callback that rclpy wants; the receive loop takes the messages instead."""
