"""Listens to the graph for a while, and notes the stamps and receive times of every topic with a header."""

import os
import time
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from rclpy.qos import QoSReliabilityPolicy

from syncrelay.cdr import read_stamp
from syncrelay.config import QosOverrides
from syncrelay.config.interfaces import Interfaces
from syncrelay.dataflow.backend import Payload, RclBackend, Source
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.errors import TypeImportError
from syncrelay.printable import printable
from syncrelay.ros.backend_choice import VARIABLE, choose_backend
from syncrelay.ros.entities import never_called
from syncrelay.ros.graph import is_nameless, is_relayed, published_topics
from syncrelay.ros.hidden_node import hidden_node
from syncrelay.ros.qos import input_profile
from syncrelay.ros.types import begins_with_header, import_type

_NODE: Final = "_syncrelay_init"
_LOOK_NS: Final = 200_000_000
_SECOND: Final = 1_000_000_000


@dataclass(slots=True)
class HeardTopic:
    """A topic whose type begins with a header, in the order of arrival.

    A stamp that cannot be read is None in `stamps`; `places` number the messages of all topics. `is_reliable` if all
    of its publishers are.
    """

    name: str
    type: str
    is_reliable: bool
    stamps: list[int | None] = field(default_factory=list)
    received: "array[int]" = field(default_factory=lambda: array("q"))
    places: "array[int]" = field(default_factory=lambda: array("q"))


@dataclass(frozen=True, slots=True)
class Heard:
    """What was heard.

    `relayed` are outputs and manifests of relays that run already; `headerless` are topics without stamps, with their
    types; `unusable` says of each topic whose type cannot be had why.
    """

    topics: tuple[HeardTopic, ...]
    relayed: tuple[str, ...]
    headerless: Mapping[str, str]
    unusable: tuple[str, ...]


def listen(*, seconds: float) -> Heard:
    """Join the graph and return what came in a time; raises RosUnavailableError where rclpy does not start."""
    with hidden_node(_NODE) as node:
        backend = choose_backend(os.environ.get(VARIABLE), node=node, context=node.context)
        return _Listener(node, backend, seconds=seconds).run()


class _Listener:
    """Subscribes to what it finds, as the relay would, and notes what comes."""

    def __init__(self, node: Any, backend: RclBackend, *, seconds: float) -> None:
        self._node, self._backend = node, backend
        now = time.monotonic_ns()
        self._due, self._end = now, now + round(seconds * _SECOND)
        self._loop = ReceiveLoop(
            backend.inbox(), now=time.monotonic_ns, deadline=lambda: min(self._due, self._end), expire=self._turn
        )
        self._topics: dict[str, HeardTopic] = {}
        self._relayed: set[str] = set()
        self._headerless: dict[str, str] = {}
        self._unusable: dict[str, str] = {}
        self._interfaces = Interfaces.find(os.environ)
        self._subscribed: list[tuple[Any, Source]] = []
        self._count = 0

    def run(self) -> Heard:
        try:
            self._loop.run()
            for _, source in self._subscribed:
                self._loop.remove(source)
        finally:
            self._loop.close()
            for subscription, _ in self._subscribed:
                self._node.destroy_subscription(subscription)
        heard = sorted(self._topics.values(), key=lambda topic: topic.name)
        return Heard(tuple(heard), tuple(sorted(self._relayed)), self._headerless, tuple(self._unusable.values()))

    def _turn(self, now: int) -> None:
        if now >= self._end:
            self._loop.stop()
            return
        self._due = now + _LOOK_NS
        for name in published_topics(self._node):
            is_known = any(name in known for known in (self._topics, self._headerless, self._relayed, self._unusable))
            if not is_known:
                self._find(name)

    def _find(self, name: str) -> None:
        publishers = self._node.get_publishers_info_by_topic(name)
        if not publishers or any(map(is_nameless, publishers)):
            return
        # If publishers have several types, one is taken: a group could not take more either.
        type_name = printable(publishers[0].topic_type)
        try:
            message_type = self._imported(type_name)
        except TypeImportError as error:
            self._unusable[name] = f"{name} ({type_name}): {str(error).splitlines()[0]}"
            return
        if not begins_with_header(message_type):
            self._headerless[name] = type_name
            return
        if any(is_relayed(self._node, each, name) for each in publishers):
            self._relayed.add(name)
            return
        profile = input_profile(
            QosOverrides(), [each.qos_profile for each in publishers if each.topic_type == type_name]
        )
        is_reliable = profile is not None and profile.reliability == QoSReliabilityPolicy.RELIABLE
        self._topics[name] = HeardTopic(name, type_name, is_reliable)
        self._subscribe(self._topics[name], message_type, profile)

    def _imported(self, type_name: str) -> Any:
        """Import a type that others name. Importing runs its package, so it must be installed as one with messages."""
        installed, package = self._interfaces, type_name.partition("/")[0]
        if installed is None or package not in installed.packages or type_name not in installed.types(package):
            raise TypeImportError("its type is not installed here, or not sourced")
        return import_type(type_name)

    def _subscribe(self, topic: HeardTopic, message_type: Any, profile: Any) -> None:
        def take(payload: Payload) -> None:
            topic.stamps.append(read_stamp(payload.content()))
            topic.received.append(payload.received)
            topic.places.append(self._count)
            self._count += 1

        subscription = self._node.create_subscription(message_type, topic.name, never_called, profile, raw=True)
        source = self._backend.source(subscription, take)
        self._subscribed.append((subscription, source))
        self._loop.add(source, _give_up)


def _give_up(error: Exception) -> None:
    raise error
