"""What a ROS is to a script, be it real or simulated."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from syncrelay.config.profile import Profile
from syncrelay.relay.ports import Graph, Node, Purpose
from syncrelay.runtime import Runtime


class Writer(Protocol):
    """A publisher of bytes."""

    @property
    def n_readers(self) -> int:
        """How many subscribers it serves."""
        ...

    def write(self, content: bytes) -> None:
        """Publish."""
        ...

    def end(self) -> None:
        """End it, in order."""
        ...


class Reader(Protocol):
    """A subscriber, which keeps what its history holds until that is taken."""

    @property
    def n_writers(self) -> int:
        """How many publishers serve it, as it knows."""
        ...

    def take(self) -> bytes | None:
        """Take the oldest message."""
        ...

    def end(self) -> None:
        """End it, in order."""
        ...


class World(Protocol):
    """A ROS. `by` names a process: who shares one shares a participant."""

    @property
    def runtime(self) -> Runtime:
        """The clocks and threads of the relay's process."""
        ...

    @property
    def graph(self) -> Graph:
        """The graph, as somebody sees it who has nothing else to do."""
        ...

    @property
    def left(self) -> Sequence[str]:
        """What the relay's process holds, and which threads run there beside its first one, where that is known."""
        ...

    def writer(self, topic: str, type_name: str, profile: Profile, *, by: str, node: str) -> Writer:
        """Make a publisher."""
        ...

    def reader(self, topic: str, type_name: str, profile: Profile, *, by: str, node: str) -> Reader:
        """Make a subscriber."""
        ...

    def leave(self, by: str) -> None:
        """Have a process end in order."""
        ...

    def kill(self, by: str) -> None:
        """Have a process end by SIGKILL."""
        ...

    def join(self, config: Any, names: Mapping[str, str], purpose: Purpose = Purpose.RELAY) -> tuple[Any, Any]:
        """Have the relay's node join, with these remaps; the node and its backend."""
        ...

    def hold(self, node: Any, topic: str, type_name: str) -> object:
        """Have the relay's own process publish on a topic, until `free`."""
        ...

    def free(self, node: Any, held: object) -> None:
        """Have it publish there no more."""
        ...

    def wait_until(self, condition: Callable[[], object], what: str) -> None:
        """Go on once something holds; raises where it never does."""
        ...

    def call(self, node: Node, service: str) -> tuple[bool, str]:
        """Call a service below the relay's name."""
        ...

    def transition(self, node: Node, name: str) -> tuple[bool, str]:
        """Ask the relay's node for a transition; whether that succeeded, and its state."""
        ...
