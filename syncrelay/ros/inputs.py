"""A topic that comes in: found in the graph, subscribed once however many groups use it, as its publishers offer."""

import importlib
import logging
import time
from collections.abc import Mapping, Sequence
from typing import Any, Final

from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from syncrelay.config import TopicConfig
from syncrelay.errors import TypeImportError
from syncrelay.explain import Endpoint, Refusal
from syncrelay.ros import graph
from syncrelay.ros.direct.rcl import RclCallError
from syncrelay.ros.entities import Entities, Purpose, RefusedError
from syncrelay.ros.group import GroupRelay
from syncrelay.ros.path import Content, Deliver, Path, Source
from syncrelay.ros.qos import input_profile, output_profile
from syncrelay.ros.receive import ReceiveLoop
from syncrelay.ros.takers import taker
from syncrelay.ros.types import begins_with_header, import_type

_LOG = logging.getLogger("syncrelay")

# What DDS refused is tried again this often, and at once after a reload, which may have freed a topic.
_TRY_AGAIN_S: Final = 5.0
# What rcl and the kernel refuse; all else is a bug of ours.
_OF_RCL: Final = (_rclpy.RCLError, RclCallError, OSError)


class User:
    """An input of a group that is fed from a topic, with what feeds it and where its messages leave."""

    __slots__ = ("group", "index", "publisher", "refusal", "take")

    def __init__(self, group: GroupRelay, index: int) -> None:
        self.group = group
        self.index = index
        self.take: Deliver | None = None
        self.publisher: Any = None
        self.refusal: Refusal | None = None
        """Why DDS does not make its publisher. Until it does nothing is fed, as sets would lack the message."""

    @property
    def output(self) -> str:
        """Where its messages leave, as the file has it."""
        return self.group.config.topics[self.index].output


class TopicInput:
    """One topic of the file, under the name that remaps give it.

    Looked at on the main thread; its entities are swapped on the receive thread.
    """

    def __init__(
        self, config: TopicConfig, *, name: str, entities: Entities, node: Any, path: Path, loop: ReceiveLoop
    ) -> None:
        self._topic = config.topic
        self.type = config.type
        self.publishers: tuple[Endpoint, ...] = ()
        self.not_importable: str | None = None
        self._qos = config.qos
        self._entities = entities
        self._node = node
        self._path = path
        self._loop = loop
        self.name = name
        self.missing: str | None = f"a publisher of {self.name} ({self.type})"
        self._refusal: Refusal | None = None
        self._try_again = 0.0
        self._wants_look = True
        self._users: list[User] = []
        self._takers: list[Deliver] = []
        self._message_type: Any = None
        self._profile: Any = None
        self._subscription: Any = None
        self._source: Source | None = None
        self._failure: Exception | None = None
        self._lost: Any = None
        self._said: set[str] = set()
        self.largest = 0
        """The size of its largest message in bytes; measured only where nothing is relayed."""

    @property
    def subscribed(self) -> bool:
        """Whether messages can come in."""
        return self._profile is not None

    @property
    def is_due(self) -> bool:
        """Whether to look at it though the graph is as before: for its type, a node's name, what DDS did not make."""
        return (
            self._wants_look
            or self._failure is not None
            or self._message_type is None
            or not all(each.is_named for each in self.publishers)
            or (self._lacks and self._may_try)
        )

    @property
    def _publishes(self) -> bool:
        return self._entities.purpose is Purpose.RELAY

    @property
    def _lacks(self) -> bool:
        return self._refusal is not None or any(user.refusal for user in self._users)

    @property
    def _may_try(self) -> bool:
        return time.monotonic() >= self._try_again

    @property
    def publisher_count(self) -> int:
        """How many publish it as the file's type."""
        return sum(publisher.type == self.type for publisher in self.publishers)

    @property
    def users(self) -> Sequence[User]:
        """Those that are fed."""
        return self._users

    @property
    def entity(self) -> Any:
        """Its subscription; None as long as there is none."""
        return self._subscription

    def refusal(self, group: GroupRelay, index: int) -> Refusal | None:
        """What DDS refuses that an input of a group needs."""
        return self._refusal or next(
            (user.refusal for user in self._users if user.group is group and user.index == index), None
        )

    def user(self, group: GroupRelay, index: int) -> User:
        """Make ready to feed an input of a group; raises TypeImportError for a field that the type does not have."""
        user = User(group, index)
        if self._message_type is not None:
            user.take = taker(group, index, self._message_type)
        return user

    def equip(self, user: User) -> None:
        """Make the publisher of one who will be attached, if it is to have one and its QoS is known.

        Raises RefusedError.
        """
        if self._publishes and self._profile is not None and user.publisher is None:
            user.publisher = self._publisher(user, self._profile)
            user.refusal = None

    def equip_or_tell(self, user: User) -> None:
        """Make its publisher, or have it told and tried again that DDS refuses."""
        try:
            self.equip(user)
        except RefusedError as error:
            user.refusal = error.refusal
            self._put_off(error)

    def attach(self, user: User) -> None:
        """Feed it from now on. On the loop's thread, or before that runs."""
        self._users.append(user)
        if user.publisher is not None:
            self._connect(user)
        self._feed_users()

    def detach(self, group: GroupRelay) -> list[User]:
        """Feed a group no longer; its users, whose publishers are to be ended. On the loop's thread."""
        gone = [user for user in self._users if user.group is group]
        self._users = [user for user in self._users if user.group is not group]
        self._feed_users()
        return gone

    def close(self) -> None:
        """Receive no longer; if it is looked at again, it begins anew. On the main thread."""
        self._wants_look = True
        source, self._source = self._source, None
        if source is not None:
            self._loop.call(lambda: self._loop.remove(source)).result()
        self._profile = self._lost = None
        if self._subscription is not None:
            self._entities.end(self._subscription)
            self._subscription = None

    def try_again(self) -> None:
        """Let the next look ask DDS again for what it refused."""
        self._try_again, self._wants_look = 0.0, True

    def look(self) -> None:
        """Look at the graph; subscribe, anew where the publishers' QoS changed; `missing` says what is not there."""
        # Until all went well it is due again, though the graph be as before.
        self._wants_look = True
        if self._failure is not None:
            self._end_failed(self._failure)
        self.missing = self._find_type() or self._find_publishers()
        self._wants_look = False

    def _end_failed(self, error: Exception) -> None:
        self._failure = None
        self.close()
        self._refused(RefusedError(Refusal("receive", self.name, self.type, why=str(error) or type(error).__name__)))
        if not isinstance(error, _OF_RCL):
            raise error

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
        if profile is not None and (self._may_try or not self._lacks):
            self._follow(profile)
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

    def rivals(self, group: GroupRelay, index: int) -> tuple[Endpoint, ...]:
        """Look at who else publishes the output that a group has for this topic.

        For one that only looks, the relay itself, which has its name, is nobody else.
        """
        output = self._node.resolve_topic_name(group.config.topics[index].output)
        ours = sum(user.publisher is not None for user in self._users if user.group is group and user.index == index)
        endpoints = self._node.get_publishers_info_by_topic(output)
        return graph.others(endpoints, than=self._entities.relay_name, own=ours if self._publishes else len(endpoints))

    def take_wait(self) -> int:
        """How long a message at most lay unread since this was last asked, in nanoseconds. On the loop's thread."""
        if self._source is None:
            return 0
        waited, self._source.waited = self._source.waited, 0
        return waited

    def lost(self) -> int:
        """How many messages DDS lost on the way here since the subscription was made."""
        return int(self._lost.take_event().total_count) if self._lost is not None else 0

    def _say_once(self, level: int, text: str) -> None:
        if text not in self._said:
            self._said.add(text)
            _LOG.log(level, "%s", text)

    def _follow(self, profile: Any) -> None:
        """Have a subscription of this QoS, and all publishers, as far as DDS makes them."""
        try:
            if profile != self._profile:
                self._adopt(profile)
        except RefusedError as error:
            self._refused(error)
            return
        self._refusal = None
        lacking = [user for user in self._users if user.publisher is None]
        for user in lacking:
            self.equip_or_tell(user)
        if any(user.publisher is not None for user in lacking):
            self._loop.call(lambda: self.connect(lacking)).result()

    def _refused(self, error: RefusedError) -> None:
        self._refusal = error.refusal
        self._put_off(error)

    def _put_off(self, error: RefusedError) -> None:
        self._try_again = time.monotonic() + _TRY_AGAIN_S
        self._say_once(logging.ERROR, str(error))

    def _adopt(self, profile: Any) -> None:
        """Replace the subscription and its outputs by ones of another QoS; raises RefusedError, with nothing changed.

        An output that DDS does not make anew goes on as it was.
        """
        subscription = self._entities.subscription(self._message_type, self._topic, profile)
        publishers: dict[User, Any] = {}
        for user in self._users if self._publishes else ():
            try:
                publishers[user] = self._publisher(user, profile)
            except RefusedError as error:
                user.refusal = None if user.publisher else error.refusal
                self._put_off(error)
        lost = None
        try:
            lost = _losses(subscription)
            source = self._path.source(subscription, self._deliver)
            old = self._loop.call(lambda: self._swap(source, publishers)).result()
        except BaseException as error:
            # It would hold on to the subscription.
            lost = None
            for entity in (*publishers.values(), subscription):
                self._entities.end(entity)
            if isinstance(error, _OF_RCL):
                raise RefusedError(Refusal("receive", self.name, self.type, why=str(error))) from error
            raise
        if self._profile is not None:
            _LOG.info("%s: its publishers' QoS changed, subscribed anew", self.name)
        self._profile, self._lost = profile, lost
        old.append(self._subscription)
        self._subscription = subscription
        for entity in old:
            if entity is not None:
                self._entities.end(entity)

    def _publisher(self, user: User, profile: Any) -> Any:
        return self._entities.publisher(self._message_type, user.output, output_profile(profile))

    def _swap(self, source: Source, publishers: Mapping[User, Any]) -> list[Any]:
        """Receive from another source, and publish by others; the publishers that are over. On the loop's thread."""
        # First what may fail.
        self._loop.add(source, self._fail)
        old = [user.publisher for user in publishers]
        for user, publisher in publishers.items():
            user.publisher, user.refusal = publisher, None
            self._connect(user)
        if self._source is not None:
            self._loop.remove(self._source)
        self._source = source
        self._feed_users()
        return old

    def _fail(self, error: Exception) -> None:
        """Hear that the source gives no more messages. On the loop's thread."""
        self._source, self._failure, self._wants_look = None, error, True

    def connect(self, users: Sequence[User]) -> None:
        """Publish by what publishers they have now, and feed those who lack none. On the loop's thread."""
        for user in users:
            if user.publisher is not None:
                self._connect(user)
        self._feed_users()

    def _connect(self, user: User) -> None:
        outlet = self._path.outlet(user.publisher)
        user.group.connect(user.index, outlet, restamped=begins_with_header(self._message_type))

    def _feed_users(self) -> None:
        self._takers = [user.take for user in self._users if user.take is not None and user.refusal is None]
        if self._source is not None:
            only = self._takers[0] if len(self._takers) == 1 and self._publishes else None
            self._source.deliver = only or (self._deliver if self._publishes else self._measure)

    def _measure(self, payload: Any, content: Content, received: int) -> None:
        self.largest = max(self.largest, len(content))
        self._deliver(payload, content, received)

    def _deliver(self, payload: Any, content: Content, received: int) -> None:
        for take in self._takers:
            take(payload, content, received)

    def wait_until_acknowledged(self, deadline: int) -> None:
        """Give reliable subscribers until `deadline`, by time.monotonic_ns(), to get what was published last."""
        for user in self._users:
            if user.publisher is not None:
                left = max(0, deadline - time.monotonic_ns())
                user.publisher.wait_for_all_acked(Duration(nanoseconds=left))


def _losses(subscription: Any) -> Any:
    """What counts the messages that DDS loses, None where it tells nothing of them. Raises RCLError."""
    try:
        return _rclpy.EventHandle(
            subscription.handle, _rclpy.rcl_subscription_event_type_t.RCL_SUBSCRIPTION_MESSAGE_LOST
        )
    except _rclpy.UnsupportedEventTypeError:
        return None
