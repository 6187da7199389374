"""How serialized messages come out of rcl and go back into it: what each backend offers to the receive loop."""

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import Any, Final, Protocol, TypeAlias

from syncrelay.dataflow.deliveries import Deliveries

Content: TypeAlias = bytes | memoryview
"""A message's bytes, to read fields from at once; they are not kept."""


class Payload(Protocol):
    """A message as the engine carries it. Its memory is free again when nobody refers to it."""

    @property
    def received(self) -> int:
        """When DDS received it, in nanoseconds of the system clock."""
        ...

    def content(self) -> Content:
        """The message's bytes."""
        ...


Deliver: TypeAlias = Callable[[Any], None]
"""Takes a payload."""


class BackendName(Enum):
    """The backends, by the names that users give them."""

    COMPILED = "compiled"
    RCLPY = "rclpy"


ALL: Final = 2**62
"""More messages than any history holds."""


class Source(Protocol):
    """A subscription that is drained."""

    deliver: Deliver
    waited: int
    """The longest that a message waited from its receipt to the poll that found it, in ns; the reader resets it."""
    pending: int
    """At most how many messages it has: those that DDS reported, or `ALL` until `take` finds no more."""

    def take(self) -> Payload | None:
        """Take its oldest message, so that one less is pending; None if there is none after all."""
        ...

    def deliveries(self) -> Sequence[Deliveries]:
        """Give what came of each publisher; of none where the middleware does not number messages."""
        ...


class RclCallError(Exception):
    """A call that rcl refused, in its words."""


class PublishError(Exception):
    """A message that rcl did not publish, and why."""


class Outlet(Protocol):
    """A publisher of payloads as they came. Raises PublishError."""

    sent: int
    """How many messages it has published: DDS numbers them alike."""

    @property
    def topic(self) -> str:
        """Where it publishes, after all remaps."""
        ...

    def send(self, payload: Any) -> None:
        """Publish a payload unchanged."""
        ...

    def send_stamped(self, payload: Any, stamp: int) -> None:
        """Publish a payload with another stamp, in nanoseconds, in its leading Header; the payload keeps its own."""
        ...

    def send_content(self, content: bytes) -> None:
        """Publish a message that was serialized here."""
        ...

    def is_heard(self) -> bool:
        """Whether anyone subscribes; False where rcl cannot say. Raises nothing."""
        ...


Ready: TypeAlias = tuple[Sequence[Source], int, bool]
"""Sources that may have messages, the time of the poll, and whether there was a wake.

Messages received up to that time, in nanoseconds of the system clock, are in these sources or in others that were not
drained since; only what DDS was just about to report may be missing. A source is drained when `take` returned None.
"""


class Watch(Protocol):
    """Tells which sources have messages."""

    def add(self, source: Any) -> None:
        """Watch one more source, of the same backend."""
        ...

    def remove(self, source: Any) -> None:
        """Watch it no longer."""
        ...

    def wait(self, timeout_ns: int) -> Ready:
        """Wait until a source gets messages, for the timeout at most, or until a wake."""
        ...

    def wake(self) -> None:
        """Have `wait` return. Any thread."""
        ...

    def close(self) -> None:
        """Free what the watch holds."""
        ...


class Inbox(Protocol):
    """Waits for messages and delivers them in the order of their receipt, whatever the topic."""

    failed: Mapping[Source, Exception]
    """The sources that could not be drained, and why, until they are removed."""

    def add(self, source: Any) -> None:
        """Drain one more source, of the same backend."""
        ...

    def remove(self, source: Any) -> None:
        """Deliver what is held of a source, and drain it no longer."""
        ...

    def receive(self, longest_ns: int) -> None:
        """Deliver what comes for so long, or until a wake or a failure."""
        ...

    def receive_once(self, longest_ns: int) -> None:
        """Wait for messages, for so long at most or until a wake, and deliver them."""
        ...

    def deliver_all(self) -> None:
        """Deliver what was received until now, however much it is."""
        ...

    def deliver_held(self) -> None:
        """Deliver the messages that are held, at the end: nothing more is taken."""
        ...

    def wake(self) -> None:
        """Have `receive` return. Any thread."""
        ...

    def close(self) -> None:
        """Free what it holds."""
        ...


class GraphChanges(Protocol):
    """Tells when the graph is worth another poll. Used on one thread."""

    def seen(self) -> bool:
        """Whether anything may have changed since this was last asked; the first time it has."""
        ...


class RclBackend(Protocol):
    """One way through rcl. Its outlets take what its sources give."""

    name: BackendName
    flow: Any
    """What takes its payloads through a group and out on its outlets: a Flow."""

    def source(self, subscription: Any, deliver: Deliver) -> Any:
        """Drain a raw rclpy subscription from now on."""
        ...

    def outlet(self, publisher: Any) -> Outlet:
        """Publish through an rclpy publisher."""
        ...

    def inbox(self) -> Inbox:
        """Make an inbox, with no sources yet."""
        ...

    def graph_changes(self, node: Any) -> GraphChanges:
        """Follow the graph as a node sees it."""
        ...
