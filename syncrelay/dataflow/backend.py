"""How serialized messages come out of rcl and go back into it: what each backend offers to the receive loop."""

from collections.abc import Callable, Sequence
from enum import Enum
from typing import Any, Protocol, TypeAlias

Content: TypeAlias = bytes | memoryview
"""A message's bytes, to read fields from at once; they are not kept."""
Deliver: TypeAlias = Callable[[Any, Content, int], None]
"""Takes a payload, its content, and the time DDS received it, in nanoseconds of the system clock."""
Taken: TypeAlias = tuple[int, Any, Content]
"""The time of receipt, the payload as the engine carries it, and its content."""


class BackendName(Enum):
    """The backends, by the names that users give them."""

    LIBRCL = "direct"
    RCLPY = "rclpy"


class Source(Protocol):
    """A subscription that is drained."""

    deliver: Deliver
    waited: int
    """The longest that a message waited from its receipt to the poll that found it, in ns; the reader resets it."""

    def take(self) -> Taken | None:
        """Take its oldest message; None if none is pending."""
        ...

    def force_poll(self) -> None:
        """Have `take` ask DDS until it has no more messages, whatever was reported as pending."""
        ...


class PublishError(Exception):
    """A message that rcl did not publish, and why."""


class Outlet(Protocol):
    """A publisher of payloads as they came. Raises PublishError."""

    sent: int
    """How many messages it has published: what DDS numbers them by."""

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
        """Whether anyone subscribes; not where that cannot be told. Raises nothing."""
        ...


Ready: TypeAlias = tuple[Sequence[Source], int]
"""Sources that may have got messages since they were drained, and the time of the poll.

Whatever was received up to that time, in nanoseconds of the system clock, is in one of them, or in one that was not
drained, but for what DDS was just about to report. A source is drained when `take` gave None.
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


class GraphChanges(Protocol):
    """Tells when the graph is worth another poll. Used on one thread."""

    def seen(self) -> bool:
        """Whether anything may have changed since this was last asked; the first time it has."""
        ...


class RclBackend(Protocol):
    """One way through rcl. Its outlets take what its sources give."""

    name: BackendName

    def source(self, subscription: Any, deliver: Deliver) -> Any:
        """Drain a raw rclpy subscription from now on."""
        ...

    def outlet(self, publisher: Any) -> Outlet:
        """Publish through an rclpy publisher."""
        ...

    def watch(self) -> Watch:
        """Make a watch, with no sources yet."""
        ...

    def graph_changes(self, node: Any) -> GraphChanges:
        """Follow the graph as a node sees it."""
        ...
