"""What DDS makes for the relay: raw subscriptions and publishers, each made or refused with a reason."""

from collections.abc import Callable
from enum import Enum
from typing import Any, Final

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from syncrelay.explain import Refusal
from syncrelay.ros.types import name_of

# The publisher that rcl makes for every node's log is not among those that rclpy knows of.
_ROSOUT: Final = ("/rosout", "rcl_interfaces/msg/Log")


class Purpose(Enum):
    """What a node is for: to relay, or to observe only, which publishes nothing."""

    RELAY = "relay"
    OBSERVE = "observe"


class RefusedError(Exception):
    """DDS does not make a publisher or subscription."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.text)
        self.refusal = refusal


class _LeftToTheReceiveLoop(CallbackGroup):  # type: ignore[misc]  # CallbackGroup is untyped
    """Keeps the node's executor, which serves parameters and the clock, away from the data."""

    def can_execute(self, entity: Any) -> bool:  # noqa: ARG002  rclpy's signature
        return False

    def beginning_execution(self, entity: Any) -> bool:  # noqa: ARG002
        return False

    def ending_execution(self, entity: Any) -> None:
        """Nothing ever begins."""


class Entities:
    """Makes and ends the subscriptions and publishers of a node. On the main thread.

    Fast DDS takes one type for each topic in a process. For a second type it prints lines of its own, and may give a
    wrong reason: so that is refused here.
    """

    def __init__(self, node: Any, purpose: Purpose) -> None:
        self._node = node
        self.purpose = purpose
        self._left_to_the_loop = _LeftToTheReceiveLoop()
        # By topic, our entities on it with their types, and those of the node itself, which never end.
        self._holders: dict[str, dict[Any, str]] = {}
        self._hold(node.resolve_topic_name(_ROSOUT[0]), node, _ROSOUT[1])
        for entity in (*node.publishers, *node.subscriptions):
            self._hold(entity.topic_name, entity, name_of(entity.msg_type))

    def subscription(self, message_type: Any, topic: str, profile: Any) -> Any:
        """Make a raw subscription that is left to the receive loop. Raises RefusedError."""

        def make() -> Any:
            # With events, the executor's thread would keep a reference to it, so that it would not end in time.
            return self._node.create_subscription(
                message_type,
                topic,
                never_called,
                profile,
                raw=True,
                callback_group=self._left_to_the_loop,
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            )

        return self._made(make, message_type, topic, "subscribe to")

    def publisher(self, message_type: Any, topic: str, profile: Any) -> Any:
        """Make a publisher. Raises RefusedError."""

        def make() -> Any:
            without_events = PublisherEventCallbacks(use_default_callbacks=False)
            return self._node.create_publisher(message_type, topic, profile, event_callbacks=without_events)

        return self._made(make, message_type, topic, "publish")

    def end(self, entity: Any) -> None:
        """End a subscription or publisher of ours."""
        name = entity.topic_name
        del self._holders[name][entity]
        if not self._holders[name]:
            del self._holders[name]
        if not self._node.destroy_publisher(entity):
            self._node.destroy_subscription(entity)

    def frees(self, topic: str, ending: set[Any]) -> bool:
        """Whether we have entities on a topic, and none once these have ended."""
        holders = self._holders.get(self._node.resolve_topic_name(topic), {}).keys()
        return bool(holders) and holders <= ending

    def _made(self, make: Callable[[], Any], message_type: Any, topic: str, verb: str) -> Any:
        name, type_name = self._node.resolve_topic_name(topic), name_of(message_type)
        held = next(iter(self._holders.get(name, {}).values()), type_name)
        if held != type_name:
            raise RefusedError(Refusal(verb, name, type_name, held_as=held))
        try:
            entity = make()
        except _rclpy.RCLError as error:
            raise RefusedError(Refusal(verb, name, type_name, why=str(error))) from error
        self._hold(name, entity, type_name)
        return entity

    def _hold(self, name: str, entity: Any, type_name: str) -> None:
        self._holders.setdefault(name, {})[entity] = type_name


def has_subscriber(publisher: Any) -> bool:
    """Whether anyone subscribes to what a publisher publishes; False where rcl cannot tell."""
    try:
        return bool(publisher.handle.get_subscription_count())
    except _rclpy.RCLError:
        return False


def never_called(_: bytes) -> None:
    """Fill the place of the callback that rclpy wants; the receive loop takes the messages instead."""
