"""What the relay needs of ROS. `syncrelay.ros` offers it through rclpy and librcl, the simulator of the tests its own.

How messages come and leave as bytes is in `syncrelay.dataflow.backend`.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias

from syncrelay.config.profile import Profile

if TYPE_CHECKING:
    from concurrent.futures import Future


class Purpose(Enum):
    """What a node is for: to relay, or to observe only, which publishes nothing."""

    RELAY = "relay"
    OBSERVE = "observe"


class RclError(Exception):
    """A call that ROS refused, in its words."""


class EndpointInfo(NamedTuple):
    """A publisher or subscriber of a topic, as the graph shows it. Others may call it anything."""

    node_name: str
    node_namespace: str
    type: str
    profile: Profile
    is_named: bool = True
    """Whether the message that names its node has arrived, or none will come."""
    uses_ros: bool = True
    """Whether it belongs to a node; what uses DDS alone has no name."""
    gid: bytes = b""
    """What tells it from all others: 16 bytes, as each of its messages has them. Empty where ROS does not say."""
    type_hash: str = ""
    """The hash of its type's definition (REP 2016), empty where ROS does not say."""


class NodeName(NamedTuple):
    """A node in the graph."""

    name: str
    namespace: str


class Graph(Protocol):
    """What a node sees of the graph. On the main thread."""

    @property
    def domain(self) -> int:
        """The number of the ROS domain."""
        ...

    def nodes(self) -> Sequence[NodeName]:
        """Return all nodes, this one too. Raises UnicodeDecodeError if the name of one is not UTF-8."""
        ...

    def topics(self) -> Mapping[str, Sequence[str]]:
        """Return the topics and their types; but for those whose name is against ROS's rules."""
        ...

    def publishers_of(self, topic: str) -> Sequence[EndpointInfo]:
        """Return the publishers of a topic, by its name in the graph."""
        ...

    def subscribers_of(self, topic: str) -> Sequence[EndpointInfo]:
        """Return the subscribers of a topic, by its name in the graph."""
        ...

    def published_by(self, node: NodeName) -> Mapping[str, Sequence[str]]:
        """Return what a node publishes, with types; nothing where that cannot be told."""
        ...

    def subscribed_by(self, node: NodeName) -> Mapping[str, Sequence[str]]:
        """Return what a node subscribes to, with types; nothing where that cannot be told."""
        ...


class Entity(Protocol):
    """A subscription or a publisher of a node."""

    @property
    def topic_name(self) -> str:
        """Its topic's name in the graph."""
        ...

    @property
    def msg_type(self) -> Any:
        """The class of its messages."""
        ...


class Subscription(Entity, Protocol):
    """A subscription whose messages a backend takes as bytes."""

    def lost(self) -> int:
        """How many messages DDS lost on the way here since it was made; 0 where DDS does not count."""
        ...


class Publisher(Entity, Protocol):
    """A publisher."""

    def publish(self, message: Any) -> None:
        """Publish an instance of `msg_type`. Raises RclError."""
        ...

    def is_heard(self) -> bool:
        """Whether anyone subscribes; False where ROS cannot tell."""
        ...

    def wait_until_acknowledged(self, patience_ns: int) -> None:
        """Give reliable subscribers so long to get what was published last."""
        ...


class Outcome(Enum):
    """How a transition of a managed node ended."""

    SUCCESS = "success"
    FAILURE = "failure"
    """The node stays as it was."""
    ERROR = "error"
    """The node is to `recover`, and is unconfigured after that."""


class Answer(NamedTuple):
    """The answer of a service that answers in words."""

    success: bool
    message: str


Call: TypeAlias = Callable[[], "Future[Answer]"]
"""Called for each request on the thread that serves the node, without waiting; the answer comes in the future."""


class Node(Protocol):
    """A node that has joined the graph. On the main thread, except where noted."""

    @property
    def name(self) -> str:
        """Its full name, with its namespace."""
        ...

    @property
    def relay_name(self) -> str:
        """The relay's full name: another one where this node only observes."""
        ...

    @property
    def graph(self) -> Graph:
        """What it sees of the graph."""
        ...

    @property
    def log_handler(self) -> logging.Handler:
        """Where the log is to go, for /rosout."""
        ...

    @property
    def is_simulated(self) -> bool:
        """Whether its parameter `use_sim_time` is true."""
        ...

    def ros_time_ns(self) -> int:
        """The time of its clock: of /clock if that is simulated, 0 before the first. Any thread."""
        ...

    def follow_clock(self, changed: Callable[[int], None]) -> Callable[[], None]:
        """Call `changed` at each change of simulated time, with its size in ns, on the thread that serves the node.

        Falls of less than a second are passed over. Returns what ends this.
        """
        ...

    def resolve_topic(self, name: str) -> str:
        """Return a topic's name after all remaps. Raises UsageError if ROS rejects that. Any thread, always."""
        ...

    def resolve_service(self, name: str) -> str:
        """Return a service's name after all remaps."""
        ...

    def own(self) -> Sequence[tuple[str, Any, str]]:
        """Return the topics of what the node has made itself, with that and its type: these never end."""
        ...

    def subscription(self, message_type: Any, topic: str, profile: Profile) -> Subscription:
        """Make a subscription that is left to a backend. Raises RclError."""
        ...

    def publisher(self, message_type: Any, topic: str, profile: Profile) -> Publisher:
        """Make a publisher. Raises RclError."""
        ...

    def serialized(self, message: Any) -> bytes:
        """Return an instance of a message class as it is published."""
        ...

    def end(self, entity: Any) -> None:
        """End a subscription or publisher."""
        ...

    def offer(self, name: str, call: Call) -> None:
        """Offer a std_srvs/srv/Trigger below the node's name."""
        ...

    def flush_answers(self, patience_s: float) -> None:
        """Give answers that are ready so long to be sent."""
        ...

    def manage(self, carry_out: Callable[[str], Outcome]) -> None:
        """Have a managed node call this at its transitions, on the thread that serves it; before `serve`.

        It is called with `configure`, `activate`, `deactivate`, `cleanup`, `shutdown` or `recover`.
        """
        ...

    def declare(self, paths: Sequence[str], version: str) -> None:
        """Declare the parameters `config`, `version` and `groups`."""
        ...

    def name_groups(self, names: Sequence[str]) -> None:
        """Set the parameter `groups`."""
        ...

    def serve(self) -> None:
        """Serve services, parameters and the clock until `end_serving`. If it raises, it may be called again."""
        ...

    def end_serving(self) -> None:
        """Have `serve` return for good. Any thread."""
        ...

    def leave(self) -> None:
        """Leave the graph; nothing else is called after that, but `resolve_topic`."""
        ...
