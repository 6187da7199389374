"""A node of the simulated ROS, and a backend: what syncrelay.relay.ports and syncrelay.dataflow.backend ask for."""

import logging
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from rclpy.serialization import serialize_message

from syncrelay.cdr import patch_stamp, read_stamp
from syncrelay.config.profile import Profile
from syncrelay.dataflow.backend import ALL, BackendName, Deliver, PublishError, Ready
from syncrelay.dataflow.deliveries import Tally
from syncrelay.dataflow.flow import Flow
from syncrelay.dataflow.inbox import PolledInbox
from syncrelay.relay.ports import Answer, Call, EndpointInfo, NodeName, Outcome, RclError
from syncrelay.relay.types import name_of
from tests.simulated.bus import BusNode, Endpoint, Participant, RefusedByDdsError
from tests.simulated.scheduler import MS, SECOND, SimulatedRuntime

if TYPE_CHECKING:
    from concurrent.futures import Future

_LOG: Final = logging.getLogger("syncrelay")
# What is made, refused and ended in DDS, for who looks into the relay.
MADE: Final = "syncrelay.made"
_MADE: Final = logging.getLogger(MADE)
_NAMELESS: Final = "_NODE_NAME_UNKNOWN_"
CLOCK_TYPE: Final = "rosgraph_msgs/msg/Clock"
_OF_EVERY_NODE: Final = {"/rosout": "rcl_interfaces/msg/Log", "/parameter_events": "rcl_interfaces/msg/ParameterEvent"}
_USUAL: Final = Profile(liveliness="automatic")
# As the relay's node asks rclpy.
_JUMP: Final = -SECOND

# Of each transition of a managed node: from which states it goes, and to which.
_TRANSITIONS: Final[Mapping[str, Mapping[str, str]]] = {
    "configure": {"unconfigured": "inactive"},
    "activate": {"inactive": "active"},
    "deactivate": {"active": "inactive"},
    "cleanup": {"inactive": "unconfigured"},
    "shutdown": {"unconfigured": "finalized", "inactive": "finalized", "active": "finalized"},
}


class SimulatedGraph:
    """What a participant has found."""

    domain = 0

    def __init__(self, participant: Participant) -> None:
        self._participant = participant

    def nodes(self) -> Sequence[NodeName]:
        return [NodeName(each.name, each.namespace) for each in self._participant.named]

    def topics(self) -> Mapping[str, Sequence[str]]:
        found: dict[str, dict[str, None]] = {}
        for each in self._participant.found:
            found.setdefault(each.topic, {})[each.type] = None
        return {topic: list(types) for topic, types in found.items()}

    def publishers_of(self, topic: str) -> Sequence[EndpointInfo]:
        return [self._info(each) for each in self._participant.found if each.topic == topic and each.is_writer]

    def subscribers_of(self, topic: str) -> Sequence[EndpointInfo]:
        return [self._info(each) for each in self._participant.found if each.topic == topic and not each.is_writer]

    def published_by(self, node: NodeName) -> Mapping[str, Sequence[str]]:
        return self._by(node, is_writer=True)

    def subscribed_by(self, node: NodeName) -> Mapping[str, Sequence[str]]:
        return self._by(node, is_writer=False)

    def _by(self, node: NodeName, *, is_writer: bool) -> Mapping[str, Sequence[str]]:
        named = [each for each in self._participant.named if (each.name, each.namespace) == node]
        return {
            each.topic: [each.type]
            for each in self._participant.found
            if each.node in named and each.is_writer is is_writer
        }

    def _info(self, each: Any) -> EndpointInfo:
        if each.node in self._participant.named:
            return EndpointInfo(each.node.name, each.node.namespace, each.type, each.shown, gid=each.gid)
        return EndpointInfo(_NAMELESS, _NAMELESS, each.type, each.shown, is_named=False, gid=each.gid)


class SimulatedSubscription:
    """A subscription."""

    def __init__(self, node: BusNode, message_type: Any, topic: str, profile: Profile) -> None:
        self.topic_name, self.msg_type = topic, message_type
        self.on_data: Callable[[], object] = lambda: None
        self.is_destroyed = False
        self.reader = node.reader(topic, name_of(message_type), profile, lambda: self.on_data())  # noqa: PLW0108  it may be another then

    def lost(self) -> int:
        return self.reader.lost


class SimulatedPublisher:
    """A publisher."""

    def __init__(
        self, node: BusNode, message_type: Any, topic: str, profile: Profile, runtime: SimulatedRuntime
    ) -> None:
        self.topic_name, self.msg_type = topic, message_type
        self.writer = node.writer(topic, name_of(message_type), profile)
        self._scheduler = runtime.scheduler
        self.refusal: str | None = None
        """Why DDS takes no message, in the way of a fault."""

    def publish(self, message: Any) -> None:
        self.send(serialize_message(message))

    def send(self, content: bytes) -> None:
        """Write bytes. Raises RclError."""
        if self.refusal is not None:
            raise RclError(self.refusal)
        self._scheduler.preempt()
        self.writer.write(content)

    def is_heard(self) -> bool:
        return self.writer.n_readers > 0

    def wait_until_acknowledged(self, patience_ns: int) -> None:
        scheduler = self._scheduler
        end = scheduler.now + patience_ns
        while not self.writer.is_acknowledged and scheduler.now < end:
            scheduler.sleep_until(min(end, scheduler.now + 5 * MS))


class SimulatedNode:
    """A node in a process of its own."""

    def __init__(
        self,
        participant: Participant,
        runtime: SimulatedRuntime,
        *,
        name: str = "syncrelay",
        namespace: str = "/",
        is_simulated: bool = False,
        remaps: Mapping[str, str] | None = None,
    ) -> None:
        self.participant = participant
        self.runtime = runtime
        self.node = participant.node(name, namespace)
        self.name = self.relay_name = self.node.full_name
        self.graph = SimulatedGraph(participant)
        self.log_handler: logging.Handler = logging.NullHandler()
        self.is_simulated = is_simulated
        self.groups: list[str] = []
        """The parameter of that name."""
        self.state = "unconfigured"
        """That of a managed node."""
        self.refusal: Callable[[str], str | None] = lambda _: None
        """Why DDS makes nothing on a topic, in the way of a fault."""
        self.publishers: list[SimulatedPublisher] = []
        self._remaps = {self._expanded(old): self._expanded(new) for old, new in (remaps or {}).items()}
        self._carry_out: Callable[[str], Outcome] | None = None
        self._offered: dict[str, Call] = {}
        self._due: deque[Callable[[], object]] = deque()
        self._served = runtime.rest()
        self._ends = self._has_said_below_0 = False
        self._time = 0
        self._follower: Callable[[int], None] | None = None
        self._own = [self.node.writer(topic, of, Profile(depth=1000)) for topic, of in _OF_EVERY_NODE.items()]
        if is_simulated:
            self._clock = self.node.reader(
                self.resolve_topic("/clock"), CLOCK_TYPE, Profile(depth=1, reliability="best_effort"), self._clock_comes
            )

    def ros_time_ns(self) -> int:
        return self._time if self.is_simulated else self.runtime.time_ns()

    def follow_clock(self, changed: Callable[[int], None]) -> Callable[[], None]:
        self._follower = changed

        def end() -> None:
            self._follower = None

        return end

    def serialized(self, message: Any) -> bytes:
        return bytes(serialize_message(message))

    def resolve_topic(self, name: str) -> str:
        return self._resolved(name)

    def resolve_service(self, name: str) -> str:
        return self._resolved(name)

    def _resolved(self, name: str) -> str:
        full = self._expanded(name)
        return self._remaps.get(full, full)

    def _expanded(self, name: str) -> str:
        if name.startswith("~/"):
            return f"{self.name}{name[1:]}"
        return name if name.startswith("/") else f"{self.node.namespace.rstrip('/')}/{name}"

    def own(self) -> Sequence[tuple[str, Any, str]]:
        return [(each.topic, each, each.type) for each in self._own]

    def subscription(self, message_type: Any, topic: str, profile: Profile) -> SimulatedSubscription:
        return self._made(lambda name: SimulatedSubscription(self.node, message_type, name, profile), topic)

    def publisher(self, message_type: Any, topic: str, profile: Profile) -> SimulatedPublisher:
        made = self._made(lambda name: SimulatedPublisher(self.node, message_type, name, profile, self.runtime), topic)
        self.publishers.append(made)
        return made

    def _made(self, make: Callable[[str], Any], topic: str) -> Any:
        name = self.resolve_topic(topic)
        self.runtime.scheduler.preempt()
        why = self.refusal(name)
        if why is not None:
            raise RclError(why)
        try:
            made = make(name)
        except RefusedByDdsError as error:
            _MADE.info("refused %s", name)
            raise RclError(str(error)) from error
        _MADE.info("+ %s", _told(made))
        return made

    def end(self, entity: Any) -> None:
        _MADE.info("- %s", _told(entity))
        if isinstance(entity, SimulatedPublisher):
            self.publishers.remove(entity)
            entity.writer.end()
        else:
            entity.is_destroyed = True
            entity.reader.end()
        self.runtime.scheduler.preempt()

    def offer(self, name: str, call: Call) -> None:
        self._offered[name] = call

    def request(self, name: str, answered: Callable[[Answer], object]) -> None:
        """Call a service, as a client in another process; the answer comes in an event, or never."""

        def serve() -> None:
            future: Future[Answer] = self._offered[name]()
            # The answer is sent on the thread that serves the node.
            future.add_done_callback(lambda told: self._serve(lambda: answered(told.result())))

        if name in self._offered:
            self.runtime.scheduler.after(MS, lambda: self._serve(serve))

    def transition(self, name: str, answered: Callable[[bool], object]) -> None:
        """Ask a managed node for a transition, as a client in another process."""
        self.runtime.scheduler.after(MS, lambda: self._serve(lambda: answered(self._carried_out(name))))

    def _carried_out(self, name: str) -> bool:
        """Carry out a transition as rclpy does; whether it succeeded."""
        goal = _TRANSITIONS[name].get(self.state)
        if goal is None or self._carry_out is None:
            _LOG.warning("refused the transition %s: the node is %s", name, self.state)
            return False
        outcome = self._carry_out(name)
        if outcome is Outcome.SUCCESS:
            self.state = goal
        elif outcome is Outcome.ERROR:
            self.state = "unconfigured" if self._carry_out("recover") is Outcome.SUCCESS else "finalized"
        return outcome is Outcome.SUCCESS

    def _serve(self, what: Callable[[], object]) -> None:
        self._due.append(what)
        self._served.set()

    def _clock_comes(self) -> None:
        self._serve(self._take_clock)

    def _take_clock(self) -> None:
        taken = self._clock.take()
        if taken is None or len(taken[0].content) < 12:
            return
        # A Time stands where a Header's stamp does.
        now = read_stamp(taken[0].content)
        if now is None:
            return
        if now < 0:
            # As the relay's adapter to rclpy says it.
            if not self._has_said_below_0:
                self._has_said_below_0 = True
                seconds = now // SECOND
                _LOG.warning("/clock is at %d s, and no time in ROS is below 0: ignored until it is 0 or more", seconds)
            return
        change, self._time = now - self._time, now
        if self._follower is not None and (change > 0 or change <= _JUMP):
            self._follower(change)

    def flush_answers(self, patience_s: float) -> None:
        scheduler = self.runtime.scheduler
        end = scheduler.now + int(patience_s * SECOND)
        while self._due and scheduler.now < end:
            scheduler.sleep_until(scheduler.now + MS)

    def manage(self, carry_out: Callable[[str], Outcome]) -> None:
        self._carry_out = carry_out

    def declare(self, paths: Sequence[str], version: str) -> None:
        """Nothing reads these."""

    def name_groups(self, names: Sequence[str]) -> None:
        self.groups = list(names)

    def serve(self) -> None:
        while not self._ends:
            while self._due:
                self._due.popleft()()
            self._served.wait(None)

    def end_serving(self) -> None:
        self._ends = True
        self._served.set()

    def leave(self) -> None:
        if self._follower is not None:
            raise RuntimeError("a node leaves whose clock is still followed")
        self.participant.leave()


def _told(entity: Any) -> str:
    end: Endpoint = entity.writer if isinstance(entity, SimulatedPublisher) else entity.reader
    unlike = [str(value) for key, value in asdict(end.profile).items() if value != getattr(_USUAL, key)]
    return " ".join(["to" if end.is_writer else "from", end.topic, *unlike])


class SimulatedPayload:
    """A message."""

    __slots__ = ("_content", "received")

    def __init__(self, content: bytes, received: int) -> None:
        self._content, self.received = content, received

    def content(self) -> bytes:
        return self._content


class SimulatedSource:
    """A subscription that is drained."""

    def __init__(self, subscription: SimulatedSubscription, deliver: Deliver) -> None:
        self.subscription = subscription
        self.deliver = deliver
        self.waited = self.pending = 0
        self.queue = subscription.reader.queue
        self._take = subscription.reader.take
        self._tally = Tally()
        self.deliveries = self._tally.read

    def take(self) -> SimulatedPayload | None:
        taken = self._take()
        if taken is None:
            self.pending = 0
            return None
        sample, received = taken
        # DDS numbers from 1.
        self._tally.note(sample.gid, sample.number + 1, sample.sent, received)
        return SimulatedPayload(sample.content, received)


class SimulatedOutlet:
    """A publisher of bytes."""

    def __init__(self, publisher: SimulatedPublisher) -> None:
        self.topic = publisher.topic_name
        self.sent = 0
        self.is_heard = publisher.is_heard
        self._send = publisher.send

    def send(self, payload: SimulatedPayload) -> None:
        self.send_content(payload.content())

    def send_stamped(self, payload: SimulatedPayload, stamp: int) -> None:
        self.send_content(patch_stamp(payload.content(), stamp))

    def send_content(self, content: bytes) -> None:
        try:
            self._send(content)
        except RclError as error:
            raise PublishError(str(error)) from error
        self.sent += 1


class SimulatedWatch:
    """Waits as on an rcl wait set: woken by several sources, it may see only some of them."""

    def __init__(self, runtime: SimulatedRuntime) -> None:
        self._rest = runtime.rest()
        self._time_ns = runtime.time_ns
        self._note_turn = runtime.scheduler.note_turn
        self._random = runtime.scheduler.stream("watch").random
        self._held = runtime.held
        self._held.add("wait set")
        self._sources: list[SimulatedSource] = []
        self._woken = False

    def add(self, source: SimulatedSource) -> None:
        self._sources.append(source)
        source.subscription.on_data = self._rest.set
        self._rest.set()

    def remove(self, source: SimulatedSource) -> None:
        self._sources.remove(source)
        source.subscription.on_data = lambda: None

    def wait(self, timeout_ns: int) -> Ready:
        seen_until = self._time_ns()
        ready = self._ready()
        # Who polls again and again while there is something gives no turn to others.
        self._note_turn()
        if not ready and not self._woken:
            self._rest.wait_ns(timeout_ns)
            ready = self._ready()
            if len(ready) > 1 and self._random() < _PARTLY:
                ready = ready[: int(self._random() * len(ready)) + 1]
        woken, self._woken = self._woken, False
        return ready, seen_until, woken

    def _ready(self) -> list[Any]:
        ready = []
        for each in self._sources:
            if each.subscription.is_destroyed:
                # As rclpy's executor: it cannot wait on what has been destroyed.
                raise RclError("Cannot use Destroyable because destruction was requested")
            if each.queue:
                ready.append(each)
        for each in ready:
            each.pending = ALL
        return ready

    def wake(self) -> None:
        self._woken = True
        self._rest.set()

    def close(self) -> None:
        self._held.discard("wait set")


_PARTLY: Final = 0.3


class SimulatedChanges:
    """Tells whether a participant has found anything new."""

    def __init__(self, participant: Participant) -> None:
        self._participant = participant
        self._seen = -1

    def seen(self) -> bool:
        before, self._seen = self._seen, self._participant.changes
        return before != self._seen


class SimulatedBackend:
    """One way through the simulated ROS."""

    name = BackendName.RCLPY

    def __init__(self, runtime: SimulatedRuntime) -> None:
        self._runtime = runtime
        self.flow: Any = partial(Flow, runtime=runtime)

    def source(self, subscription: SimulatedSubscription, deliver: Deliver) -> SimulatedSource:
        return SimulatedSource(subscription, deliver)

    def outlet(self, publisher: SimulatedPublisher) -> SimulatedOutlet:
        return SimulatedOutlet(publisher)

    def inbox(self) -> PolledInbox:
        return PolledInbox(SimulatedWatch(self._runtime), runtime=self._runtime)

    def graph_changes(self, node: SimulatedNode) -> SimulatedChanges:
        return SimulatedChanges(node.participant)
