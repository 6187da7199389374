"""The inputs of groups that one topic feeds, and the publishers by which its messages leave."""

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rclpy.duration import Duration

from syncrelay.dataflow.backend import Deliver, Outlet, Payload, RclBackend, Source
from syncrelay.dataflow.group import GroupRelay
from syncrelay.errors import TypeImportError
from syncrelay.explain import Refusal
from syncrelay.ros.entities import Entities, Purpose, RefusedError
from syncrelay.ros.handlers import handler
from syncrelay.ros.qos import output_profile
from syncrelay.ros.types import begins_with_header

if TYPE_CHECKING:
    from syncrelay.ros.inputs import TopicInput


class InputBinding:
    """An input of a group: the topic that feeds it, what handles its messages, and where they leave."""

    __slots__ = ("_outlet", "group", "handler", "index", "not_readable", "publisher", "publisher_refusal", "topic")

    def __init__(self, group: GroupRelay, index: int, topic: "TopicInput") -> None:
        self.group = group
        self.index = index
        self.topic = topic
        self.handler: Deliver | None = None
        self.publisher: Any = None
        self.publisher_refusal: Refusal | None = None
        """Why DDS does not make its publisher. Until it does, nothing is fed: sets would lack the message."""
        self.not_readable: str | None = None
        """Why the stamp or key that the file names cannot be read from messages of the type."""
        self._outlet: tuple[Any, Outlet] | None = None

    @property
    def output(self) -> str:
        """Where its messages leave, as the file has it."""
        return self.group.config.topics[self.index].output

    @property
    def refusal(self) -> Refusal | None:
        """What DDS refuses that it needs."""
        return self.topic.refusal or self.publisher_refusal

    @property
    def missing(self) -> str | None:
        """What it waits for, in words."""
        if self.topic.missing:
            return self.topic.missing
        if self.not_readable:
            return f"the field of {self.topic.name} that the file names"
        return f"DDS to let it {self.refusal.verb} {self.refusal.topic}" if self.refusal else None

    def outlet(self, backend: RclBackend) -> Outlet:
        """Return the outlet of its publisher: the same for as long as that is, so that it counts what was sent."""
        if self._outlet is None or self._outlet[0] is not self.publisher:
            self._outlet = self.publisher, backend.outlet(self.publisher)
        return self._outlet[1]

    def find_handler(self, message_type: Any) -> None:
        """Have messages of this type handled; `not_readable` says why they cannot be."""
        try:
            self.handler, self.not_readable = handler(self.group, self.index, message_type), None
        except TypeImportError as error:
            self.not_readable = str(error)


class Outputs:
    """Feeds the inputs of groups from one topic. On the main thread, where nothing else is said."""

    def __init__(self, *, entities: Entities, backend: RclBackend) -> None:
        self.bindings: list[InputBinding] = []
        self.source: Source | None = None
        """What feeds them; None as long as nothing does."""
        self.largest = 0
        """The size of the largest message in bytes; measured only where nothing is published."""
        self._handlers: list[Deliver] = []
        self._entities = entities
        self._backend = backend
        self._publishes = entities.purpose is Purpose.RELAY

    @property
    def are_refused(self) -> bool:
        """Whether DDS does not make one of the publishers."""
        return any(binding.publisher_refusal for binding in self.bindings)

    def make_publisher(self, binding: InputBinding, message_type: Any, profile: Any) -> None:
        """Make the publisher of one that has none, unless nothing is to be published. Raises RefusedError."""
        if self._publishes and binding.publisher is None:
            binding.publisher = self._made(binding, message_type, profile)
            binding.publisher_refusal = None

    def remake(self, message_type: Any, profile: Any) -> tuple[dict[InputBinding, Any], list[Refusal]]:
        """Make publishers of another QoS. What DDS refuses stays as it was."""
        made: dict[InputBinding, Any] = {}
        refused = []
        for binding in self.bindings if self._publishes else ():
            try:
                made[binding] = self._made(binding, message_type, profile)
            except RefusedError as error:
                binding.publisher_refusal = None if binding.publisher else error.refusal
                # The error itself would hold on to its callers, and so to what they end.
                refused.append(error.refusal)
        return made, refused

    def _made(self, binding: InputBinding, message_type: Any, profile: Any) -> Any:
        return self._entities.publisher(message_type, binding.output, output_profile(profile))

    def wait_until_acknowledged(self, deadline: int) -> None:
        """Give reliable subscribers until `deadline`, by time.monotonic_ns(), to get what was published last."""
        for binding in self.bindings:
            if binding.publisher is not None:
                left = max(0, deadline - time.monotonic_ns())
                binding.publisher.wait_for_all_acked(Duration(nanoseconds=left))

    # These run on the loop's thread, or before that runs.

    def attach(self, binding: InputBinding) -> None:
        """Feed it from now on."""
        self.bindings.append(binding)
        self.connect([binding])

    def detach(self, group: GroupRelay) -> None:
        """Feed a group no longer."""
        self.bindings = [binding for binding in self.bindings if binding.group is not group]
        self.feed()

    def exchange(self, source: Source | None, publishers: Mapping[InputBinding, Any]) -> list[Any]:
        """Be fed by another source, and publish by these publishers; those that they replace."""
        self.source = source
        old = [binding.publisher for binding in publishers]
        for binding, publisher in publishers.items():
            binding.publisher, binding.publisher_refusal = publisher, None
        self.connect(list(publishers))
        return old

    def connect(self, bindings: Sequence[InputBinding]) -> None:
        """Publish by the publishers that they have now, and feed those who lack none."""
        for binding in bindings:
            if binding.publisher is not None:
                restamped = begins_with_header(binding.publisher.msg_type)
                binding.group.connect(binding.index, binding.outlet(self._backend), restamped=restamped)
        self.feed()

    def feed(self) -> None:
        """Feed those that have a handler, whose messages can leave, and whose group is awake."""
        fed = [each for each in self.bindings if not each.publisher_refusal and not each.group.sleeps]
        self._handlers = [each.handler for each in fed if each.handler]
        if self.source is None:
            return
        if self._publishes:
            self.source.deliver = self._handlers[0] if len(self._handlers) == 1 else self.deliver
        else:
            self.source.deliver = self._measure

    def _measure(self, payload: Payload) -> None:
        self.largest = max(self.largest, len(payload.content()))
        self.deliver(payload)

    def deliver(self, payload: Payload) -> None:
        """Feed all of them a message."""
        for handle in self._handlers:
            handle(payload)
