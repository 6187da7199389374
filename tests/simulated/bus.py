"""A simulated DDS: discovery, matching by QoS, histories, losses and deaths, as they were observed of Fast DDS.

Participants find each other, and each endpoint, after a time and in any order; the name of an endpoint's node comes by
another message. A writer sends to a reader from when it has found it, and a reader takes from writers that it has
found. Reliable data is resent, for as long as the writer's history holds it; other data may be lost. A dead participant
stays in the graph until its lease ends. All times are in nanoseconds.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from operator import attrgetter
from typing import Any, Final, NamedTuple

from syncrelay.config.profile import Profile, mismatch
from tests.simulated.scheduler import MS, SECOND, Process, Scheduler

# As rmw_fastrtps has it: who is dead is forgotten after that, and says that it lives every 3 s.
_LEASE: Final = 20 * SECOND
_SIGN_OF_LIFE: Final = 3 * SECOND
# A reliable writer asks its readers what they lack at its next message, or after so long.
_HEARTBEAT: Final = 3 * SECOND
# What a process that stands still can be sent: ports of shared memory hold so many.
_PORT: Final = 512
_KEPT: Final = 5000


# Observed: what is left to the system.
_WRITER_DEFAULTS: Final[Mapping[str, Any]] = {
    "liveliness": "automatic",
    "reliability": "reliable",
    "durability": "transient_local",
}
_READER_DEFAULTS: Final[Mapping[str, Any]] = {
    "liveliness": "automatic",
    "reliability": "best_effort",
    "durability": "volatile",
}


class RefusedByDdsError(Exception):
    """DDS does not make an endpoint."""


@dataclass(slots=True)
class Weather:
    """How the network is; times in nanoseconds. The world may change it at any moment."""

    discovery: int = 100 * MS
    """The longest that an endpoint is found after."""
    missed: float = 0.0
    """The share of participants that are found only when the announcement is repeated, after up to 3 s.

    Observed: 0.3 to 0.6. The others were found after 0.1 s, and all with their endpoints; the names of their nodes came
    10 to 120 ms later. The end of an endpoint, or a farewell, was heard within 7 ms.
    """
    latency: int = 1 * MS
    """The longest that a message usually takes."""
    loss: float = 0.0
    """The share of messages that are lost on the way once."""


class Sample(NamedTuple):
    """A message as it is sent."""

    number: int
    """How many the writer had written before."""
    content: bytes
    sent: int
    """By the writer's system clock."""
    gid: bytes
    """Its writer's."""


class Endpoint:
    """A writer or a reader of a node."""

    is_writer: bool

    def __init__(self, node: "BusNode", topic: str, type_name: str, profile: Profile) -> None:
        self.node = node
        self.participant = node.participant
        self.bus = node.participant.bus
        self.topic = topic
        self.type = type_name
        defaults = _WRITER_DEFAULTS if self.is_writer else _READER_DEFAULTS
        left = {key: value for key, value in defaults.items() if getattr(profile, key) == "system_default"}
        self.profile = replace(profile, **left)
        # Observed: the graph does not tell histories.
        self.shown: Final = replace(self.profile, history="unknown", depth=0)
        """What the graph tells of that."""
        self.depth: Final = _KEPT if profile.history == "keep_all" else max(1, profile.depth)
        """How many messages its history keeps."""
        self.is_ended = False
        self.gid = next(node.participant.bus.gids).to_bytes(16)
        self.links: dict[Endpoint, Link] = {}
        """By the other end: what is connected, or about to be."""

    def end(self) -> None:
        """End it, in order: others hear of it."""
        self.is_ended = True
        self.participant.endpoints.pop(self, None)
        self.bus.withdraw(self)


class Writer(Endpoint):
    """A writer."""

    is_writer = True

    def __init__(self, node: "BusNode", topic: str, type_name: str, profile: Profile) -> None:
        self.written = 0
        self.history: deque[Sample] = deque(maxlen=_KEPT if profile.history == "keep_all" else max(1, profile.depth))
        super().__init__(node, topic, type_name, profile)

    @property
    def n_readers(self) -> int:
        """How many readers it has found that it serves."""
        return sum(link.is_sending for link in self.links.values())

    @property
    def is_acknowledged(self) -> bool:
        """Whether its reliable readers have all that was written."""
        return not any(link.under_way for link in self.links.values() if link.is_reliable)

    def write(self, content: bytes, *, dies: bool = False) -> None:
        """Write a message; with `dies`, its process is killed in the midst of that."""
        bus = self.bus
        sample = Sample(self.written, content, self.participant.process.time_ns(), self.gid)
        self.written += 1
        self.history.append(sample)
        if bus.written is not None:
            bus.written(self, sample)
        links = [link for link in self.links.values() if link.is_sending] if self.links else []
        if dies:
            links = links[: int(bus.random() * (len(links) + 1))]
        for link in links:
            link.send(sample)
        if dies:
            self.participant.process.kill()
            bus.buried(self.participant)

    def holds(self, sample: Sample) -> bool:
        """Whether its history still has a message, to resend it."""
        return not self.participant.process.is_dead and self.written - sample.number <= self.depth


class Reader(Endpoint):
    """A reader; `on_data` is called for each message that arrives, in an event."""

    is_writer = False

    def __init__(
        self, node: "BusNode", topic: str, type_name: str, profile: Profile, on_data: Callable[[], object]
    ) -> None:
        self.queue: deque[tuple[Sample, int]] = deque(maxlen=_KEPT)
        """What has not been taken, with the time of its receipt by the system clock of its process."""
        self.lost = 0
        self.on_data = on_data
        self.is_sink = False
        """Whether nobody asks what it gets, or when: so nothing is sent."""
        super().__init__(node, topic, type_name, profile)

    @property
    def n_writers(self) -> int:
        """How many writers it has found that serve it."""
        return sum(link.is_receiving for link in self.links.values())

    def take(self) -> tuple[Sample, int] | None:
        """Take the oldest message, and when it was received."""
        lifespan = self.profile.lifespan
        while self.queue:
            sample, received = self.queue.popleft()
            if not lifespan or self.participant.process.time_ns() - sample.sent <= lifespan:
                if self.bus.taken is not None:
                    self.bus.taken(self, sample)
                return sample, received
        return None


class Link:
    """A writer and a reader that fit.

    Observed: each finds the other for itself, up to a second apart. What a reliable writer sends in between arrives,
    to volatile readers too; by best effort it is lost. A message of 0 bytes never arrives: by best effort the next ones
    do; a reliable reader gets nothing more until the writer's history has dropped that message, and then all it holds.
    Not simulated: of a burst from a writer of depth 1, a reliable reader may lack some; in one of two runs it did.
    """

    def __init__(self, writer: Writer, reader: Reader) -> None:
        self.writer, self.reader = writer, reader
        self.is_sending = False
        """Whether the writer has found the reader."""
        self.is_receiving = False
        """Whether the reader has found the writer."""
        self.is_reliable = "best_effort" not in (writer.profile.reliability, reader.profile.reliability)
        self.waiting: list[Sample] = []
        """What was sent before the reader had found the writer, or while its process stood still."""
        self.last = 0
        self.under_way = 0
        self.empty: Sample | None = None
        """A message of 0 bytes for which a reliable reader waits."""
        self.behind: list[Sample] = []
        """What was sent after that."""
        self.expected: int | None = None

    def found_by_writer(self) -> None:
        """Begin to send."""
        self.is_sending = True
        wants_past = "transient_local" == self.writer.profile.durability == self.reader.profile.durability
        if wants_past and self.writer.written > len(self.writer.history):
            # Observed: what the history has dropped counts as one loss. Had the reader found the writer, it is one.
            self.reader.lost += 1
            if self.is_receiving and self.writer.bus.lost is not None:
                self.writer.bus.lost(self.reader)
        lifespan, now = self.writer.profile.lifespan, self.writer.participant.process.time_ns()
        for sample in list(self.writer.history) if wants_past else ():
            # Observed: what has outlived this in the writer's history is not sent; what a reader has by then stays.
            if not lifespan or now - sample.sent <= lifespan:
                self.send(sample)

    def found_by_reader(self) -> None:
        """Begin to receive."""
        self.is_receiving = True
        if not self.is_reliable or self.writer.participant.process.is_dead:
            self.under_way -= len(self.waiting)
            self.waiting.clear()
        self._send_waiting()

    def send(self, sample: Sample) -> None:
        """Send a message on its way."""
        if self.reader.is_sink:
            return
        if (self.empty is not None or not sample.content) and not self._may_pass(sample):
            return
        bus = self.writer.bus
        scheduler, weather, process = bus.scheduler, bus.weather, self.reader.participant.process
        self.under_way += 1
        if not self.is_receiving or process.is_dead or process.stalled_until > scheduler.now:
            self.waiting.append(sample)
            return
        when = scheduler.now + int(weather.latency * bus.random() ** 2)
        resent = weather.loss > 0 and bus.random() < weather.loss
        if resent:
            if not self.is_reliable:
                self._lose(sample)
                return
            when += int(_HEARTBEAT * bus.random() ** 4) + MS
        self.last = when = max(when, self.last)
        scheduler.at(when, partial(self._arrive, sample, resent=resent))

    def _may_pass(self, sample: Sample) -> bool:
        if self.empty is not None and not self.writer.holds(self.empty):
            behind, self.behind, self.empty = self.behind, [], None
            for each in behind:
                self.send(each)
        if self.empty is None and sample.content:
            return True
        if self.empty is not None:
            self.behind.append(sample)
        elif self.is_reliable:
            self.empty = sample
        return False

    def _send_waiting(self) -> None:
        # What is resent reaches a process that stands still after what was sent later: DDS hands on in order.
        waiting, self.waiting = sorted(self.waiting, key=attrgetter("number")), []
        bus = self.writer.bus
        for number, sample in enumerate(waiting):
            if self.is_reliable and self.writer.holds(sample):
                self.last = max(self.last, bus.scheduler.now + int(20 * MS * bus.random()))
            elif number >= _PORT:
                self._lose(sample)
                continue
            else:
                self.last = max(self.last, bus.scheduler.now)
            bus.scheduler.at(self.last, partial(self._arrive, sample, resent=False))

    def go_on(self) -> None:
        """Have what was sent to a process that stood still arrive."""
        if self.is_receiving:
            self._send_waiting()

    def _lose(self, sample: Sample) -> None:
        self.under_way -= 1
        if self.writer.bus.lost is not None:
            self.writer.bus.lost(self.reader)
        if self.expected is not None:
            self.reader.lost += 1
            self.expected = sample.number + 1

    def _arrive(self, sample: Sample, *, resent: bool) -> None:
        reader = self.reader
        if reader.is_ended or not self.is_receiving:
            return
        process = reader.participant.process
        if process.is_still:
            self.waiting.append(sample)
            return
        if resent and not self.writer.holds(sample):
            self._lose(sample)
            return
        self.under_way -= 1
        self.expected = sample.number + 1
        if len(reader.queue) >= reader.depth:
            reader.queue.popleft()
        reader.queue.append((sample, process.time_ns()))
        reader.on_data()
        if self.writer.bus.arrived is not None:
            self.writer.bus.arrived(reader)


class BusNode:
    """A node, as the graph shows it."""

    def __init__(self, participant: "Participant", name: str, namespace: str) -> None:
        self.participant = participant
        self.name, self.namespace = name, namespace

    @property
    def full_name(self) -> str:
        return f"{self.namespace.rstrip('/')}/{self.name}"

    def writer(self, topic: str, type_name: str, profile: Profile) -> Writer:
        """Make a writer. Raises RefusedByDdsError."""
        return self.participant.make(Writer(self, topic, type_name, profile))

    def reader(
        self, topic: str, type_name: str, profile: Profile, on_data: Callable[[], object] = lambda: None
    ) -> Reader:
        """Make a reader. Raises RefusedByDdsError."""
        return self.participant.make(Reader(self, topic, type_name, profile, on_data))


class Participant:
    """A participant of a process, and what it has found of others."""

    def __init__(self, bus: "Bus", process: Process) -> None:
        self.bus = bus
        self.process = process
        self.nodes: list[BusNode] = []
        self.endpoints: dict[Endpoint, None] = {}
        self.found: dict[Endpoint, None] = {}
        """The endpoints that it has found, its own too, in the order in which it did."""
        self.named: dict[BusNode, None] = {}
        """The nodes whose names it has, its own too."""
        self.changes = 0
        """How often what it has found has changed."""
        self.has_left = False
        self.on_change: Callable[[], object] = lambda: None

    def node(self, name: str, namespace: str = "/") -> BusNode:
        """Make a node."""
        made = BusNode(self, name, namespace or "/")
        self.nodes.append(made)
        self.bus.announce_node(made)
        return made

    def make(self, endpoint: Any) -> Any:
        """Have an endpoint found. Raises RefusedByDdsError for a second type on a topic."""
        self.bus.may_make(endpoint)
        held = next((each.type for each in self.endpoints if each.topic == endpoint.topic), endpoint.type)
        if held != endpoint.type:
            if not endpoint.is_writer:
                # Observed: rcl replaces the words of rmw_fastrtps by these.
                raise RefusedByDdsError("Failed to create subscription: invalid allocator")
            # The words of rmw_fastrtps, which rcl passes on.
            raise RefusedByDdsError(
                f"Failed to create publisher: create_publisher() called for existing topic name rt{endpoint.topic}"
                f" with incompatible type {endpoint.type.replace('/', '::').replace('::msg::', '::msg::dds_::')}_"
            )
        self.endpoints[endpoint] = None
        self.bus.announce(endpoint)
        return endpoint

    def leave(self) -> None:
        """Leave in order."""
        for endpoint in list(self.endpoints):
            endpoint.end()
        self.bus.left(self)

    def kill(self) -> None:
        """End the process as SIGKILL does."""
        self.process.kill()
        self.bus.buried(self)

    def see(self, endpoint: Endpoint) -> None:
        """Find an endpoint."""
        if endpoint.is_ended or self.process.is_dead or endpoint in self.found:
            return
        self.found[endpoint] = None
        for mine in [each for each in self.endpoints if each.topic == endpoint.topic]:
            self._connect(mine, endpoint)
        self._change()

    def _connect(self, mine: Endpoint, other: Endpoint) -> None:
        if isinstance(mine, Writer) and isinstance(other, Reader):
            link = self.bus.link(mine, other)
            if link is not None and not link.is_sending:
                link.found_by_writer()
        elif isinstance(mine, Reader) and isinstance(other, Writer):
            link = self.bus.link(other, mine)
            if link is not None and not link.is_receiving:
                link.found_by_reader()

    def found_own(self, endpoint: Endpoint) -> None:
        """Match an endpoint that was just made with all that was found before."""
        self.found[endpoint] = None
        for other in [each for each in self.found if each.topic == endpoint.topic]:
            self._connect(endpoint, other)
            if other.participant is self:
                self._connect(other, endpoint)
        self._change()

    def lose(self, endpoint: Endpoint) -> None:
        """Hear that an endpoint has ended."""
        if self.found.pop(endpoint, self) is None:
            for mine in [each for each in self.endpoints if each.topic == endpoint.topic]:
                mine.links.pop(endpoint, None)
            self._change()

    def learn(self, node: BusNode) -> None:
        """Hear the name of a node, and which endpoints are its."""
        if not self.process.is_dead and not node.participant.has_left:
            self.named[node] = None
            self._change()

    def forget(self, other: "Participant") -> None:
        """Forget a participant that left, or whose lease has ended."""
        for endpoint in [each for each in self.found if each.participant is other]:
            self.lose(endpoint)
        for node in other.nodes:
            self.named.pop(node, None)
        self._change()

    def _change(self) -> None:
        self.changes += 1
        self.on_change()


class Bus:
    """The DDS of one domain."""

    def __init__(self, scheduler: Scheduler, weather: Weather | None = None) -> None:
        self.scheduler = scheduler
        self.weather = weather or Weather()
        self.random = scheduler.stream("bus").random
        self.participants: list[Participant] = []
        self.gids = count(1)
        self._met: dict[tuple[Participant, Participant], int] = {}
        """When the first of two finds the second."""
        self.written: Callable[[Writer, Sample], object] | None = None
        """Called at each write."""
        self.taken: Callable[[Reader, Sample], object] | None = None
        """Called for each message that a reader takes."""
        self.arrived: Callable[[Reader], object] | None = None
        """Called for each message that has arrived at a reader, before it can be taken."""
        self.lost: Callable[[Reader], object] | None = None
        """Called for each message that is lost on the way to a reader."""
        self.may_make: Callable[[Endpoint], object] = lambda _: None
        """Called before each endpoint is made: what it raises, as a RefusedByDdsError, refuses that."""

    def participant(self, process: Process) -> Participant:
        """Have a process join."""
        made = Participant(self, process)
        others = list(self._others(made))
        self.participants.append(made)
        process.on_go_on.append(lambda: self._go_on(made))
        for other in others:
            self._met[made, other], self._met[other, made] = self._meeting(), self._meeting()
            for node in other.nodes:
                self._later(made, other, partial(made.learn, node))
            for endpoint in other.endpoints:
                self._later(made, other, partial(made.see, endpoint))
        return made

    def _meeting(self) -> int:
        """Draw when a participant that joins is found by another, or finds it."""
        missed = self.random() < self.weather.missed
        return self.scheduler.now + (int(_HEARTBEAT * (0.7 + 0.3 * self.random())) if missed else 0)

    def announce_node(self, node: BusNode) -> None:
        """Have others hear a node's name."""
        node.participant.learn(node)
        for other in self._others(node.participant):
            self._later(other, node.participant, partial(other.learn, node))

    def announce(self, endpoint: Endpoint) -> None:
        """Have others find an endpoint."""
        endpoint.participant.found_own(endpoint)
        for other in self._others(endpoint.participant):
            self._later(other, endpoint.participant, partial(other.see, endpoint))

    def withdraw(self, endpoint: Endpoint) -> None:
        """Have others hear that an endpoint has ended."""
        endpoint.participant.lose(endpoint)
        for other in self._others(endpoint.participant):
            self._later(other, endpoint.participant, partial(other.lose, endpoint))

    def left(self, participant: Participant) -> None:
        """Have others hear that a participant has left."""
        participant.has_left = True
        self.participants.remove(participant)
        for other in self.participants:
            self._later(other, participant, partial(other.forget, participant))

    def buried(self, participant: Participant) -> None:
        """Have others forget a dead participant, each when its lease ends there."""
        participant.has_left = True
        self.participants.remove(participant)
        for other in self.participants:
            delay = _LEASE - int(_SIGN_OF_LIFE * self.random())
            self.scheduler.after(delay, partial(other.forget, participant))

    def link(self, writer: Writer, reader: Reader) -> Link | None:
        """Return what connects these, None if they do not fit."""
        link = writer.links.get(reader)
        if link is None and not writer.is_ended and not reader.is_ended:
            if writer.type != reader.type or mismatch(writer.profile, reader.profile) is not None:
                return None
            link = writer.links[reader] = reader.links[writer] = Link(writer, reader)
        return link

    def _go_on(self, participant: Participant) -> None:
        for endpoint in participant.endpoints:
            for link in list(endpoint.links.values()) if isinstance(endpoint, Reader) else ():
                link.go_on()

    def _others(self, than: Participant) -> Iterator[Participant]:
        return (each for each in self.participants if each is not than)

    def _later(self, of: Participant, other: Participant, event: Callable[[], object]) -> None:
        """Do what a participant hears of another, once it runs."""

        def hear() -> None:
            process = of.process
            if process.is_dead:
                return
            if process.is_still:
                self.scheduler.at(process.stalled_until, hear)
            else:
                event()

        # Mostly soon, and at times not.
        when = self.scheduler.now + int(self.weather.discovery * self.random() ** 2) + 1
        self.scheduler.at(max(when, self._met.get((of, other), 0)), hear)
