"""What DDS makes for the relay: raw subscriptions and publishers, each made or refused with a reason."""

from collections.abc import Callable
from typing import Any, TypeVar

from syncrelay.config.profile import Profile
from syncrelay.explain import Refusal
from syncrelay.relay.ports import Entity, Node, Publisher, Purpose, RclError, Subscription
from syncrelay.relay.types import name_of

_Made = TypeVar("_Made", bound=Entity)


class RefusedError(Exception):
    """DDS does not make a publisher or subscription."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.text)
        self.refusal = refusal


class Entities:
    """Makes and ends the subscriptions and publishers of a node. On the main thread.

    Fast DDS takes one type for each topic in a process. For a second type it prints lines of its own, and may give a
    wrong reason: so that is refused here.
    """

    def __init__(self, node: Node, purpose: Purpose) -> None:
        self._node = node
        self.purpose = purpose
        # By topic, our entities on it with their types, and those of the node itself, which never end.
        self._holders: dict[str, dict[Any, str]] = {}
        for topic, entity, type_name in node.own():
            self._hold(topic, entity, type_name)

    def subscription(self, message_type: Any, topic: str, profile: Profile) -> Subscription:
        """Make a subscription that is left to the receive loop. Raises RefusedError."""
        return self._made(self._node.subscription, message_type, topic, profile, "subscribe to")

    def publisher(self, message_type: Any, topic: str, profile: Profile) -> Publisher:
        """Make a publisher. Raises RefusedError."""
        return self._made(self._node.publisher, message_type, topic, profile, "publish")

    def end(self, entity: Any) -> None:
        """End a subscription or publisher of ours."""
        name = entity.topic_name
        del self._holders[name][entity]
        if not self._holders[name]:
            del self._holders[name]
        self._node.end(entity)

    def frees(self, topic: str, ending: set[Any]) -> bool:
        """Whether we have entities on a topic, and none once these have ended."""
        holders = self._holders.get(self._node.resolve_topic(topic), {}).keys()
        return bool(holders) and holders <= ending

    def _made(
        self, make: Callable[[Any, str, Profile], _Made], message_type: Any, topic: str, profile: Profile, verb: str
    ) -> _Made:
        name, type_name = self._node.resolve_topic(topic), name_of(message_type)
        held = next(iter(self._holders.get(name, {}).values()), type_name)
        if held != type_name:
            raise RefusedError(Refusal(verb, name, type_name, held_as=held))
        try:
            entity = make(message_type, topic, profile)
        except RclError as error:
            raise RefusedError(Refusal(verb, name, type_name, why=str(error))) from error
        self._hold(name, entity, type_name)
        return entity

    def _hold(self, name: str, entity: Any, type_name: str) -> None:
        self._holders.setdefault(name, {})[entity] = type_name
