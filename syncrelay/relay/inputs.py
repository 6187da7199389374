"""A topic that comes in: found in the graph, subscribed once however many groups use it, as its publishers offer."""

import importlib
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from syncrelay.config import TopicConfig
from syncrelay.config.profile import Profile, is_known, matched
from syncrelay.dataflow.backend import RclBackend, RclCallError, Source
from syncrelay.dataflow.bugs import OnceLog
from syncrelay.dataflow.deliveries import Deliveries
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.errors import TypeImportError
from syncrelay.explain import Endpoint, Refusal
from syncrelay.relay.entities import Entities, RefusedError
from syncrelay.relay.graph import as_publishers
from syncrelay.relay.outputs import BundleOutput, Output, Outputs, handler
from syncrelay.relay.ports import EndpointInfo, Entity, Graph, Publisher, RclError, Subscription
from syncrelay.relay.types import SettlingType, import_type, name_of
from syncrelay.runtime import Runtime

_LOG = logging.getLogger("syncrelay")

# Requests that DDS refused are repeated this often, and at once after a reload, which may have freed a topic.
_TRY_AGAIN_S: Final = 5.0
# Errors of ROS and of the kernel; all others are bugs of ours.
_OF_ROS: Final = (RclError, RclCallError, OSError)


class TopicInput:
    """One topic of the file, under the name that remaps give it.

    Polled on the main thread; its entities are swapped on the receive thread.
    """

    def __init__(
        self,
        config: TopicConfig,
        *,
        name: str,
        entities: Entities,
        graph: Graph,
        backend: RclBackend,
        loop: ReceiveLoop,
        runtime: Runtime,
    ) -> None:
        self.name = name
        self.type = config.type
        self.publishers: tuple[Endpoint, ...] = ()
        self.not_importable: str | None = None
        self.type_from: Endpoint | None = None
        """The publisher whose type was taken because the file has none; that type stays."""
        self.missing: str | None = self._publisher_words
        self.outputs = Outputs(entities=entities, backend=backend, runtime=runtime)
        self.refusal: Refusal | None = None
        """Why DDS does not make the subscription."""
        self.profile: Profile | None = None
        """The QoS of the subscription and of the outputs; None until it is known."""
        self.entity: Subscription | None = None
        """The subscription; None while there is none, as when all groups that use it sleep."""
        self._topic = config.topic
        self._qos = config.qos
        self._entities = entities
        self._graph = graph
        self._backend = backend
        self._loop = loop
        self._runtime = runtime
        self._message_type: Any = None
        self._settling = SettlingType()
        self._failure: Exception | None = None
        self._is_held = False
        self._force_poll = True
        self._try_again = 0.0
        self._once = OnceLog()

    @property
    def is_due(self) -> bool:
        """Whether to poll it though the graph has not changed, because something is missing or was refused."""
        return (
            self._force_poll
            or self._failure is not None
            or (self._message_type is None and (self.type is not None or bool(self.publishers)))
            or not all(each.is_named for each in self.publishers)
            or any(output.not_readable for output in self.outputs.all)
            or (self._is_refused and self._may_try)
        )

    @property
    def _is_refused(self) -> bool:
        return self.refusal is not None or self.outputs.are_refused

    @property
    def _is_wanted(self) -> bool:
        """Whether a group that uses it is awake."""
        return not all(output.group.sleeps for output in self.outputs.all)

    @property
    def _may_try(self) -> bool:
        return self._runtime.monotonic() >= self._try_again

    @property
    def _publisher_words(self) -> str:
        return f"a publisher of {self.name}{f' ({self.type})' if self.type else ''}"

    def bind(self, group: GroupRelay, index: int, bundle: BundleOutput) -> "InputBinding":
        """Make ready to feed an input of a group; raises TypeImportError for a field that the type does not have."""
        output = Output(group, index, bundle)
        if self._message_type is not None:
            output.handler = handler(group, index, self._message_type)
        return InputBinding(self, output)

    def keep_type(self, publisher: Endpoint) -> None:
        """Take the type of this publisher, as before a reload, if the file has none."""
        if self.type is None:
            self.type, self.type_from = publisher.type, publisher

    def make_publisher(self, output: Output) -> None:
        """Make the publisher of one that is bound, if its QoS is known. Raises RefusedError."""
        if self.profile is not None:
            self.outputs.make_publisher(output, self._message_type, self.profile)

    def make_publisher_or_report(self, output: Output) -> None:
        """Make its publisher, or log that DDS refuses it, and try again later."""
        try:
            self.make_publisher(output)
        except RefusedError as error:
            output.refusal = error.refusal
            self._put_off(error.refusal)

    def close(self) -> None:
        """Stop receiving; if it is polled again, it starts again. On the main thread."""
        self._force_poll = True
        source, self.outputs.source = self.outputs.source, None
        if source is not None:
            self._loop.call(lambda: self._loop.remove(source)).result()
        self.profile = None
        if self.entity is not None:
            self._entities.end(self.entity)
            self.entity = None

    def hold(self) -> None:
        """Receive nothing any more; the graph is polled all the same. On the main thread."""
        self._is_held = True
        self.close()

    def try_again(self) -> None:
        """Have the next poll ask DDS again for what it refused."""
        self._try_again, self._force_poll = 0.0, True

    def poll(self) -> None:
        """Poll the graph and subscribe, again where the publishers' QoS changed; `missing` says what is missing."""
        # If something fails here, it is due again though the graph has not changed.
        self._force_poll = True
        if self._failure is not None:
            self._end_failed(self._failure)
        endpoints = self._graph.publishers_of(self.name)
        self.publishers = as_publishers(endpoints, self.profile)
        self.missing = self._find_type() or self._find_publishers(endpoints)
        self._force_poll = False

    def _end_failed(self, error: Exception) -> None:
        self._failure = None
        self.close()
        self._refused(self._refusal(str(error) or type(error).__name__))
        if not isinstance(error, _OF_ROS):
            raise error

    def _find_type(self) -> str | None:
        lacking = [output for output in self.outputs.all if output.handler is None]
        if self._message_type is not None and not lacking:
            return None
        importlib.invalidate_caches()
        if self._message_type is None and (missing := self._import_type()):
            return missing
        for output in lacking:
            output.find_handler(self._message_type)
            if output.not_readable:
                self._once.log(logging.ERROR, f"{output.group.config.name}: {self.name}: {output.not_readable}")
        if self.outputs.source is not None:
            self._loop.call(self.outputs.feed).result()
        return None

    def _import_type(self) -> str | None:
        """Import the file's type, or the one that the topic's publishers have; return what is missing."""
        self.not_importable = None
        publisher = (
            self._settling.publisher(self.publishers, now=self._runtime.monotonic()) if self.type is None else None
        )
        type_name = publisher.type if publisher is not None else self.type
        if type_name is None:
            return f"the type of {self.name}" if self.publishers else self._publisher_words
        try:
            self._message_type = import_type(type_name)
        except TypeImportError as error:
            self.not_importable = str(error)
            self._once.log(logging.ERROR, f"{self.name}: {error}")
            return f"the type {type_name} of {self.name}"
        if publisher is not None:
            self.type, self.type_from = type_name, publisher
            _LOG.info("%s: %s, as %s publishes it", self.name, type_name, publisher.node)
        return None

    def _find_publishers(self, endpoints: Sequence[EndpointInfo]) -> str | None:
        offered = [endpoint.profile for endpoint in endpoints if endpoint.type == self.type]
        if is_known(self._qos, offered) and not self._is_held and (self._may_try or not self._is_refused):
            self._follow(matched(self._qos, offered))
        self.publishers = as_publishers(endpoints, self.profile)
        expected = f"the relay took {self.type}" if self.type_from else f"the file says {self.type}"
        for stranger in self.publishers:
            if stranger.type != self.type:
                self._once.log(
                    logging.WARNING,
                    f"{self.name}: {stranger.node} publishes it as {stranger.type}, {expected}",
                )
        served = [each for each in self.publishers if each.type == self.type]
        if not served:
            return self._publisher_words
        if all(each.mismatch for each in served):
            return f"a publisher of {self.name} with compatible QoS"
        return None

    def take_wait(self) -> int:
        """Return the longest wait of a message since the last call, in nanoseconds. On the loop's thread."""
        source, waited = self.outputs.source, 0
        if source is not None:
            waited, source.waited = source.waited, 0
        return waited

    def deliveries(self) -> Sequence[Deliveries]:
        """Give what came of each publisher. On the loop's thread."""
        source = self.outputs.source
        return source.deliveries() if source is not None else ()

    def lost(self) -> int:
        """How many messages DDS lost on the way here since the subscription was made."""
        return self.entity.lost() if self.entity is not None else 0

    def _follow(self, profile: Profile) -> None:
        """Have a subscription of this QoS, if one is wanted, and all publishers, as far as DDS makes them."""
        try:
            if profile != self.profile or self._is_wanted is (self.entity is None):
                self._exchange(profile)
        except RefusedError as error:
            self._refused(error.refusal)
            return
        self.refusal = None
        lacking = [output for output in self.outputs.all if output.publisher is None]
        for output in lacking:
            self.make_publisher_or_report(output)
        if any(output.publisher is not None for output in lacking):
            self._loop.call(lambda: self.outputs.connect(lacking)).result()

    def _refusal(self, why: str) -> Refusal:
        return Refusal("receive", self.name, name_of(self._message_type), why=why)

    def _refused(self, refusal: Refusal) -> None:
        self.refusal = refusal
        self._put_off(refusal)

    def _put_off(self, refusal: Refusal) -> None:
        self._try_again = self._runtime.monotonic() + _TRY_AGAIN_S
        self._once.log(logging.ERROR, refusal.text)

    def _exchange(self, profile: Profile) -> None:
        """Replace the subscription, by none if none is wanted; of another QoS, the outputs too.

        Raises RefusedError, with nothing changed. An output that DDS does not make again stays as it was.
        """
        is_wanted, publishers, refused = self._is_wanted, dict[Output, Publisher](), list[Refusal]()
        subscription = self._entities.subscription(self._message_type, self._topic, profile) if is_wanted else None
        if profile != self.profile:
            publishers, refused = self.outputs.remake(self._message_type, profile)
        for refusal in refused:
            self._put_off(refusal)
        source = None
        try:
            if subscription is not None:
                source = self._backend.source(subscription, self.outputs.deliver)
            old = self._loop.call(lambda: self._swap(source, publishers)).result()
        except BaseException as error:
            self._end(*publishers.values(), subscription)
            if isinstance(error, _OF_ROS):
                raise RefusedError(self._refusal(str(error))) from error
            raise
        if self.entity is not None and subscription is not None:
            _LOG.info("%s: subscribed again, because the QoS of its publishers changed", self.name)
        before, self.profile, self.entity = self.entity, profile, subscription
        self._end(*old, before)

    def _end(self, *entities: Entity | None) -> None:
        for entity in entities:
            if entity is not None:
                self._entities.end(entity)

    def _swap(self, source: Source | None, publishers: Mapping[Output, Publisher]) -> list[Publisher | None]:
        """Receive from another source, or none, publish by others; the publishers that end. On the loop's thread."""
        # This may fail, so it comes first.
        if source is not None:
            self._loop.add(source, self._fail)
        before = self.outputs.source
        old = self.outputs.exchange(source, publishers)
        if before is not None:
            self._loop.remove(before)
        return old

    def _fail(self, error: Exception) -> None:
        """Note that the source gives no more messages. On the loop's thread."""
        self.outputs.source, self._failure = None, error


@dataclass(frozen=True, slots=True, eq=False)
class InputBinding:
    """An input of a group: the topic that feeds it, and the output by which its messages leave."""

    topic: TopicInput
    output: Output

    @property
    def refusal(self) -> Refusal | None:
        """What DDS refuses that it needs."""
        return self.topic.refusal or self.output.refusal

    @property
    def missing(self) -> str | None:
        """What it waits for, in words."""
        if self.topic.missing:
            return self.topic.missing
        if self.output.not_readable:
            return f"the field of {self.topic.name} that the file names"
        return f"DDS to let it {self.refusal.verb} {self.refusal.topic}" if self.refusal else None
