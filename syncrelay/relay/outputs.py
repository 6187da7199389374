"""What one topic feeds: handlers that read stamps and keys for groups, and publishers by which the messages leave."""

from collections.abc import Mapping, Sequence
from typing import Any

from syncrelay.cdr import has_place_for_stamp, read_stamp
from syncrelay.config.profile import Profile, sent
from syncrelay.dataflow.backend import Deliver, Outlet, Payload, RclBackend, Source
from syncrelay.dataflow.group import GroupRelay
from syncrelay.errors import TypeImportError
from syncrelay.explain import Refusal
from syncrelay.frames import read_frame
from syncrelay.relay.entities import Entities, RefusedError
from syncrelay.relay.ports import Publisher, Purpose
from syncrelay.relay.types import begins_with_header, stamp_reader, value_reader
from syncrelay.runtime import Runtime


class BundleOutput:
    """The bundles of a group on their way out: their publisher and its QoS, and why they cannot be published."""

    __slots__ = ("profile", "publisher", "refusal")

    def __init__(self) -> None:
        self.publisher: Publisher | None = None
        self.profile: Profile | None = None
        self.refusal: Refusal | None = None


class Output:
    """An input of a group on its way out: what handles its messages, and the publisher by which they leave."""

    __slots__ = ("_outlet", "bundle", "group", "handler", "index", "not_readable", "publisher", "refusal")

    def __init__(self, group: GroupRelay, index: int, bundle: BundleOutput) -> None:
        self.group = group
        self.index = index
        self.bundle = bundle
        self.handler: Deliver | None = None
        self.not_readable: str | None = None
        """Why the stamp or key that the file names cannot be read from messages of the type."""
        self.publisher: Publisher | None = None
        self.refusal: Refusal | None = None
        """Why DDS does not make its publisher. Until it does, nothing is fed: sets would lack the message."""
        self._outlet: tuple[Publisher | None, Outlet] | None = None

    @property
    def topic(self) -> str:
        """Where its messages leave, as the file has it."""
        return self.group.config.topics[self.index].output

    @property
    def is_separate(self) -> bool:
        """Whether its messages leave on a topic of their own, and not only in bundles."""
        return self.group.config.options.outputs

    @property
    def waits_for_bundle(self) -> bool:
        """Whether sets would leave without their bundle, because its publisher is about to be made."""
        has_bundle, flow = self.group.config.bundle is not None, self.group.flow
        return has_bundle and flow.bundle is None and self.bundle.refusal is None

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
    """Feeds the inputs of groups from one topic. To be used on the main thread, except where noted."""

    def __init__(self, *, entities: Entities, backend: RclBackend, runtime: Runtime) -> None:
        self.all: list[Output] = []
        self.source: Source | None = None
        """The source that feeds them, None while there is none."""
        self.largest = 0
        """The size of the largest message in bytes; measured only where nothing is published."""
        self._handlers: list[Deliver] = []
        self._entities = entities
        self._backend = backend
        self._runtime = runtime
        self._publishes = entities.purpose is Purpose.RELAY

    @property
    def are_refused(self) -> bool:
        """Whether DDS does not make one of the publishers."""
        return any(output.refusal for output in self.all)

    def make_publisher(self, output: Output, message_type: Any, profile: Profile) -> None:
        """Make the publisher of one that has none, unless nothing is to be published. Raises RefusedError."""
        if self._publishes and output.is_separate and output.publisher is None:
            output.publisher = self._made(output, message_type, profile)
            output.refusal = None

    def remake(self, message_type: Any, profile: Profile) -> tuple[dict[Output, Publisher], list[Refusal]]:
        """Make publishers of another QoS; return them, and what DDS refused. Refused outputs stay as they were."""
        made: dict[Output, Publisher] = {}
        refused = []
        for output in self.all if self._publishes else ():
            if not output.is_separate:
                continue
            try:
                made[output] = self._made(output, message_type, profile)
            except RefusedError as error:
                output.refusal = None if output.publisher else error.refusal
                # The error itself would keep its callers' frames alive, and so the entities that they end.
                refused.append(error.refusal)
        return made, refused

    def _made(self, output: Output, message_type: Any, profile: Profile) -> Publisher:
        return self._entities.publisher(message_type, output.topic, sent(profile))

    def wait_until_acknowledged(self, deadline: int) -> None:
        """Give reliable subscribers until `deadline`, by time.monotonic_ns(), to get what was published last."""
        for output in self.all:
            if output.publisher is not None:
                output.publisher.wait_until_acknowledged(max(0, deadline - self._runtime.monotonic_ns()))

    # These run on the loop's thread, or before that runs.

    def attach(self, output: Output) -> None:
        """Feed it from now on."""
        self.all.append(output)
        self.connect([output])

    def detach(self, group: GroupRelay) -> None:
        """Feed a group no longer."""
        self.all = [output for output in self.all if output.group is not group]
        self.feed()

    def exchange(self, source: Source | None, publishers: Mapping[Output, Publisher]) -> list[Publisher | None]:
        """Be fed by another source, publish through these publishers, and return those that they replace."""
        self.source = source
        old = [output.publisher for output in publishers]
        for output, publisher in publishers.items():
            output.publisher, output.refusal = publisher, None
        self.connect(list(publishers))
        return old

    def connect(self, outputs: Sequence[Output]) -> None:
        """Publish through the publishers that these have now, and feed those that lack none."""
        for output in outputs:
            if output.publisher is not None:
                restamped = begins_with_header(output.publisher.msg_type)
                output.group.connect(output.index, output.outlet(self._backend), restamped=restamped)
        self.feed()

    def feed(self) -> None:
        """Feed those that have a handler, whose messages can leave, and whose group is awake."""
        fed = [each for each in self.all if not each.refusal and not each.group.sleeps]
        if self._publishes:
            fed = [each for each in fed if not each.waits_for_bundle]
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


def handler(group: GroupRelay, index: int, message_type: Any) -> Deliver:
    """Return what handles messages of a type for an input of a group; raises TypeImportError for a missing field.

    What it returns raises nothing: an exception stops the group, and no other group on the topic.
    """
    topic = group.config.topics[index]
    read = stamp_reader(topic.stamp, message_type)
    clock = group.clocks[index]
    read_its_frame = None
    if group.config.options.transforms is not None and begins_with_header(message_type):
        read_its_frame = read_frame
    if read is read_stamp and topic.key is None and clock is None and read_its_frame is None:
        return group.flow.by_header(index, group.fail)
    read_key = None if topic.key is None else value_reader(message_type, topic.key)
    has_place = None
    if group.config.restamp is not None and topic.stamp != "header" and begins_with_header(message_type):
        has_place = has_place_for_stamp

    def handle(payload: Payload) -> None:
        try:
            content = payload.content()
            stamp = read(content) if read else payload.received
            key = read_key(content) if read_key else None
            # Without a key, or without a place for the common stamp, a message counts as malformed.
            if (read_key and key is None) or (has_place and not has_place(content)):
                stamp = None
            elif clock is not None and stamp is not None:
                stamp = clock.host_time(stamp, payload.received)
            group.flow.receive(index, payload, stamp, key, read_its_frame(content) if read_its_frame else None)
        except Exception as error:  # noqa: BLE001  it stops the group alone
            group.fail(error)

    return handle
