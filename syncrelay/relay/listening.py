"""Listens to the graph for a while, and notes the stamps and receive times of every topic with a header."""

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from syncrelay.cdr import read_stamp
from syncrelay.config.interfaces import Interfaces
from syncrelay.config.profile import Profile, matched
from syncrelay.config.qos import AUTO
from syncrelay.dataflow.backend import Payload, RclBackend, Source
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.errors import TypeImportError
from syncrelay.printable import printable
from syncrelay.relay.graph import is_relayed, published_topics
from syncrelay.relay.ports import EndpointInfo, Node, Subscription
from syncrelay.relay.types import begins_with_header, import_type
from syncrelay.runtime import SYSTEM, Runtime

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


class Listener:
    """Subscribes to what it finds, as the relay would, and notes what comes."""

    def __init__(
        self,
        node: Node,
        backend: RclBackend,
        *,
        seconds: float,
        interfaces: Interfaces | None,
        runtime: Runtime = SYSTEM,
    ) -> None:
        """Take what is installed here, None for nothing."""
        self._node, self._backend = node, backend
        now = runtime.monotonic_ns()
        self._due, self._end = now, now + round(seconds * _SECOND)
        self._loop = ReceiveLoop(
            backend.inbox(),
            now=runtime.monotonic_ns,
            deadline=lambda: min(self._due, self._end),
            expire=self._turn,
            runtime=runtime,
        )
        self._topics: dict[str, HeardTopic] = {}
        self._relayed: set[str] = set()
        self._headerless: dict[str, str] = {}
        self._unusable: dict[str, str] = {}
        self._interfaces = interfaces
        self._subscribed: list[tuple[Subscription, Source]] = []
        self._count = 0

    def run(self) -> Heard:
        """Return what came."""
        try:
            self._loop.run()
            for _, source in self._subscribed:
                self._loop.remove(source)
        finally:
            self._loop.close()
            for subscription, _ in self._subscribed:
                self._node.end(subscription)
        heard = sorted(self._topics.values(), key=lambda topic: topic.name)
        return Heard(tuple(heard), tuple(sorted(self._relayed)), self._headerless, tuple(self._unusable.values()))

    def _turn(self, now: int) -> None:
        if now >= self._end:
            self._loop.stop()
            return
        self._due = now + _LOOK_NS
        for name, publishers in published_topics(self._node.graph).items():
            is_known = any(name in known for known in (self._topics, self._headerless, self._relayed, self._unusable))
            if not is_known:
                self._find(name, publishers)

    def _find(self, name: str, publishers: Sequence[EndpointInfo]) -> None:
        if not all(each.is_named for each in publishers):
            return
        # If publishers have several types, one is taken: a group could not take more either.
        type_name = printable(publishers[0].type)
        try:
            message_type = self._imported(type_name)
        except TypeImportError as error:
            self._unusable[name] = f"{name} ({type_name}): {str(error).splitlines()[0]}"
            return
        if not begins_with_header(message_type):
            self._headerless[name] = type_name
            return
        if any(is_relayed(self._node.graph, each, name) for each in publishers):
            self._relayed.add(name)
            return
        profile = matched(AUTO, [each.profile for each in publishers if each.type == type_name])
        self._topics[name] = HeardTopic(name, type_name, profile.reliability == "reliable")
        self._subscribe(self._topics[name], message_type, profile)

    def _imported(self, type_name: str) -> Any:
        """Import a type that others name. Importing runs its package, so it must be installed as one with messages."""
        installed, package = self._interfaces, type_name.partition("/")[0]
        if installed is None or package not in installed.packages or type_name not in installed.types(package):
            raise TypeImportError("its type is not installed here, or not sourced")
        return import_type(type_name)

    def _subscribe(self, topic: HeardTopic, message_type: Any, profile: Profile) -> None:
        def take(payload: Payload) -> None:
            topic.stamps.append(read_stamp(payload.content()))
            topic.received.append(payload.received)
            topic.places.append(self._count)
            self._count += 1

        subscription = self._node.subscription(message_type, topic.name, profile)
        source = self._backend.source(subscription, take)
        self._subscribed.append((subscription, source))
        self._loop.add(source, _give_up)


def _give_up(error: Exception) -> None:
    raise error
