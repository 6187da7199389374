"""Topics that come in: found in the graph, subscribed once however many groups use them, as their publishers offer."""

import importlib
import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from syncrelay.cdr import has_place_for_stamp
from syncrelay.config import TopicConfig
from syncrelay.errors import TypeImportError
from syncrelay.explain import Endpoint
from syncrelay.ros import graph
from syncrelay.ros.group import GroupRelay
from syncrelay.ros.path import Content, Deliver, Path, Source
from syncrelay.ros.qos import input_profile, output_profile
from syncrelay.ros.receive import ReceiveLoop
from syncrelay.ros.types import begins_with_header, import_type, stamp_reader, value_reader
from syncrelay.sync import DropReason

_LOG = logging.getLogger("syncrelay")


class _LeftToTheReceiveLoop(CallbackGroup):  # type: ignore[misc]  # CallbackGroup is untyped
    """Keeps the node's executor, which serves parameters and the clock, away from the data."""

    def can_execute(self, entity: Any) -> bool:  # noqa: ARG002  rclpy's signature
        return False

    def beginning_execution(self, entity: Any) -> bool:  # noqa: ARG002
        return False

    def ending_execution(self, entity: Any) -> None:
        """Nothing ever begins."""


class User:
    """An input of a group that is fed from a topic, with what feeds it and where its messages leave."""

    __slots__ = ("group", "index", "publisher", "take")

    def __init__(self, group: GroupRelay, index: int) -> None:
        self.group = group
        self.index = index
        self.take: Deliver | None = None
        self.publisher: Any = None


class TopicInput:
    """One topic of the file, under the name that remaps give it.

    Looked at on the main thread; its entities are swapped on the receive thread.
    """

    def __init__(self, config: TopicConfig, *, name: str, node: Any, path: Path, loop: ReceiveLoop) -> None:
        self._topic = config.topic
        self.type = config.type
        self.publishers: tuple[Endpoint, ...] = ()
        self.not_importable: str | None = None
        self._qos = config.qos
        self._node = node
        self._path = path
        self._loop = loop
        self.name = name
        self.missing: str | None = f"a publisher of {self.name} ({self.type})"
        self._callback_group = _LeftToTheReceiveLoop()
        self._users: list[User] = []
        self._takers: list[Deliver] = []
        self._message_type: Any = None
        self._profile: Any = None
        self._subscription: Any = None
        self._source: Source | None = None
        self._lost: Any = None
        self._said: set[str] = set()

    @property
    def subscribed(self) -> bool:
        """Whether messages can come in."""
        return self._profile is not None

    @property
    def has_type(self) -> bool:
        """Whether its type is imported; until then it is to be looked at though the graph be as before."""
        return self._message_type is not None

    @property
    def publisher_count(self) -> int:
        """How many publish it as the file's type."""
        return sum(publisher.type == self.type for publisher in self.publishers)

    def user(self, group: GroupRelay, index: int) -> User:
        """Make ready to feed an input of a group; raises TypeImportError for a field that the type does not have."""
        user = User(group, index)
        if self._message_type is not None:
            user.take = taker(group, index, self._message_type)
        if self._profile is not None:
            user.publisher = self._publisher(user, self._profile)
        return user

    def attach(self, user: User) -> None:
        """Feed it from now on. On the loop's thread, or before that runs."""
        self._users.append(user)
        if user.publisher is not None:
            self._connect(user)
        self._feed_users()

    def detach(self, group: GroupRelay) -> list[User]:
        """Feed a group no longer; its users, whose publishers are to be destroyed. On the loop's thread."""
        gone = [user for user in self._users if user.group is group]
        self._users = [user for user in self._users if user.group is not group]
        self._feed_users()
        return gone

    @property
    def is_used(self) -> bool:
        """Whether a group is fed."""
        return bool(self._users)

    def close(self) -> None:
        """Receive no longer. On the main thread."""
        source = self._source
        if source is not None:
            self._loop.call(lambda: self._loop.remove(source)).result()
            self._node.destroy_subscription(self._subscription)
            self._source = self._subscription = self._lost = None

    def look(self) -> None:
        """Look at the graph; subscribe, anew where the publishers' QoS changed; `missing` says what is not there."""
        self.missing = self._find_type() or self._find_publishers()

    def _find_type(self) -> str | None:
        if self._message_type is not None:
            return None
        importlib.invalidate_caches()
        try:
            message_type = import_type(self.type)
            for user in self._users:
                user.take = taker(user.group, user.index, message_type)
        except TypeImportError as error:
            self.not_importable = str(error)
            self._say_once(logging.ERROR, f"{self.name}: {error}")
            return f"the type {self.type} of {self.name}"
        self.not_importable = None
        self._message_type = message_type
        return None

    def _find_publishers(self) -> str | None:
        endpoints = self._node.get_publishers_info_by_topic(self.name)
        fitting = [endpoint for endpoint in endpoints if endpoint.topic_type == self.type]
        profile = input_profile(self._qos, [endpoint.qos_profile for endpoint in fitting])
        if profile is not None and profile != self._profile:
            self._adopt(profile)
        self.publishers = graph.publishers(endpoints, self._profile)
        for stranger in self.publishers:
            if stranger.type != self.type:
                self._say_once(logging.WARNING, self._of_another_type(stranger))
        served = [each for each in self.publishers if each.type == self.type]
        if not served:
            return f"a publisher of {self.name} ({self.type})"
        if all(each.mismatch for each in served):
            return f"a publisher of {self.name} whose QoS fits"
        return None

    def _of_another_type(self, endpoint: Endpoint) -> str:
        return f"{self.name}: {endpoint.node} publishes it as {endpoint.type}, the file says {self.type}"

    def subscribers(self, group: GroupRelay, index: int) -> tuple[Endpoint, ...]:
        """Look at who subscribes the output that a group has for this topic."""
        if self._profile is None:
            return ()
        output = self._node.resolve_topic_name(group.config.topics[index].output)
        return graph.subscribers(self._node.get_subscriptions_info_by_topic(output), self._profile)

    def lost(self) -> int:
        """How many messages DDS lost on the way here since the subscription was made."""
        return int(self._lost.take_event().total_count) if self._lost is not None else 0

    def _say_once(self, level: int, text: str) -> None:
        if text not in self._said:
            self._said.add(text)
            _LOG.log(level, "%s", text)

    def _adopt(self, profile: Any) -> None:
        """Replace the subscription and its outputs by ones of another QoS."""
        if self._profile is not None:
            _LOG.info("%s: its publishers' QoS changed, subscribing anew", self.name)
        subscription = self._node.create_subscription(
            self._message_type,
            self._topic,
            _never_called,
            profile,
            raw=True,
            callback_group=self._callback_group,
        )
        publishers = [self._publisher(user, profile) for user in self._users]
        self._profile = profile
        self._lost = _rclpy.EventHandle(
            subscription.handle, _rclpy.rcl_subscription_event_type_t.RCL_SUBSCRIPTION_MESSAGE_LOST
        )
        self._loop.call(lambda: self._swap(subscription, publishers)).result()

    def _publisher(self, user: User, profile: Any) -> Any:
        output = user.group.config.topics[user.index].output
        return self._node.create_publisher(self._message_type, output, output_profile(profile))

    def _swap(self, subscription: Any, publishers: list[Any]) -> None:
        old = [user.publisher for user in self._users if user.publisher is not None]
        for user, publisher in zip(self._users, publishers, strict=True):
            user.publisher = publisher
            self._connect(user)
        if self._source is not None:
            self._loop.remove(self._source)
            self._node.destroy_subscription(self._subscription)
        for publisher in old:
            self._node.destroy_publisher(publisher)
        self._subscription = subscription
        self._source = self._path.source(subscription, self._deliver)
        self._feed_users()
        self._loop.add(self._source)

    def _connect(self, user: User) -> None:
        outlet = self._path.outlet(user.publisher)
        user.group.connect(user.index, outlet, restamped=begins_with_header(self._message_type))

    def _feed_users(self) -> None:
        self._takers = [user.take for user in self._users if user.take is not None]
        if self._source is not None:
            self._source.deliver = self._takers[0] if len(self._takers) == 1 else self._deliver

    def _deliver(self, payload: Any, content: Content, received: int) -> None:
        for take in self._takers:
            take(payload, content, received)

    def wait_until_acknowledged(self, deadline: int) -> None:
        """Give reliable subscribers until `deadline`, by time.monotonic_ns(), to get what was published last."""
        for user in self._users:
            if user.publisher is not None:
                left = max(0, deadline - time.monotonic_ns())
                user.publisher.wait_for_all_acked(Duration(nanoseconds=left))


def taker(group: GroupRelay, index: int, message_type: Any) -> Deliver:
    """What feeds one input of a group from messages of a type; raises TypeImportError where a field is not there."""
    take = _taker(group, index, message_type)
    topic = group.config.topics[index]
    if group.config.restamp is None or topic.stamp == "header" or not begins_with_header(message_type):
        return take

    def take_if_it_can_be_restamped(payload: Any, content: Content, received: int) -> None:
        if has_place_for_stamp(content):
            take(payload, content, received)
        else:
            group.receive(index, payload, received, None)

    return take_if_it_can_be_restamped


def _taker(group: GroupRelay, index: int, message_type: Any) -> Deliver:
    topic = group.config.topics[index]
    read_stamp = stamp_reader(topic.stamp, message_type)
    if topic.key is not None:
        read_key = value_reader(message_type, topic.key)
        return lambda payload, content, received: group.receive_keyed(
            index, payload, received, read_stamp(content) if read_stamp else received, read_key(content)
        )
    if read_stamp is None:
        return lambda payload, _, received: group.receive(index, payload, received, received)
    return lambda payload, content, received: group.receive(index, payload, received, read_stamp(content))


def _never_called(_: bytes) -> None:
    """Fill the place of the callback that rclpy wants; the receive loop takes the messages instead."""


@dataclass(frozen=True, slots=True)
class Wiring:
    """A group and the topics that feed it, in the order of its inputs."""

    group: GroupRelay
    inputs: tuple[TopicInput, ...]

    @property
    def waiting_for(self) -> str | None:
        """What keeps the group from giving sets, in words."""
        inputs = zip(self.group.config.topics, self.inputs, strict=True)
        return ", ".join(each.missing for topic, each in inputs if each.missing and topic.required) or None


class Wirings:
    """All groups that run, in the file's order; one input per topic, however many use it and whatever they call it."""

    def __init__(self, *, node: Any, path: Path, loop: ReceiveLoop) -> None:
        self.all: tuple[Wiring, ...] = ()
        self._node = node
        self._path = path
        self._loop = loop
        self._inputs: dict[tuple[str, str, str], TopicInput] = {}

    @property
    def groups(self) -> list[GroupRelay]:
        """The groups alone."""
        return [wiring.group for wiring in self.all]

    @property
    def inputs(self) -> list[TopicInput]:
        """Each topic once."""
        return list(self._inputs.values())

    def wire(self, groups: Sequence[GroupRelay]) -> None:
        """Let these groups run, and no other; those that did go on as they are. On the main thread.

        What is new begins, and what is gone ends, between two messages. Raises TypeImportError, with nothing
        changed, for a field that a type does not have.
        """
        running = {wiring.group: wiring for wiring in self.all}
        inputs = dict(self._inputs)
        wirings = tuple(running.get(group) or self._wiring(group, inputs) for group in groups)
        users = [
            (topic_input, topic_input.user(wiring.group, index))
            for wiring in wirings
            if wiring.group not in running
            for index, topic_input in enumerate(wiring.inputs)
        ]
        ended = [wiring for group, wiring in running.items() if group not in groups]
        gone = self._loop.call(lambda: _switch(ended, users)).result() if running else _switch(ended, users)
        for user in gone:
            if user.publisher is not None:
                self._node.destroy_publisher(user.publisher)
        for topic_input in inputs.values():
            if not topic_input.is_used:
                topic_input.close()
        self._inputs = {key: topic_input for key, topic_input in inputs.items() if topic_input.is_used}
        self.all = wirings

    def _wiring(self, group: GroupRelay, inputs: dict[tuple[str, str, str], TopicInput]) -> Wiring:
        return Wiring(group, tuple(self._input(topic, inputs) for topic in group.config.topics))

    def _input(self, topic: TopicConfig, inputs: dict[tuple[str, str, str], TopicInput]) -> TopicInput:
        name = self._node.resolve_topic_name(topic.topic)
        key = (name, topic.type, repr(topic.qos))
        if key not in inputs:
            inputs[key] = TopicInput(topic, name=name, node=self._node, path=self._path, loop=self._loop)
        return inputs[key]


def _switch(ended: Sequence[Wiring], users: Sequence[tuple[TopicInput, User]]) -> list[User]:
    """End some groups and begin others; the users that are gone. On the loop's thread, or before that runs."""
    gone = []
    for wiring in ended:
        wiring.group.flush(DropReason.SHUTDOWN)
        for topic_input in wiring.inputs:
            gone += topic_input.detach(wiring.group)
    for topic_input, user in users:
        topic_input.attach(user)
    return gone
