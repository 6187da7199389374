"""What was seen of the graph in a few seconds: plain values."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SeenPublisher:
    """A publisher: its node, its type, what it offers in words, and why it cannot serve what is asked of it.

    `node` is empty where DDS found the publisher, but the message that tells its node did not arrive.
    """

    node: str
    type: str
    offers: str
    mismatch: str | None = None


@dataclass(frozen=True, slots=True)
class SeenTopic:
    """A topic of the file, under its name in the graph.

    `delays` are receive time minus stamp of each message that had both, in nanoseconds, the file's offset left out;
    with simulated time the clock's value at that moment stands for the time. `alike` are topics of the graph that
    may have been meant. `largest` is the size of the largest message, in bytes.
    """

    name: str
    type: str
    publishers: tuple[SeenPublisher, ...] = ()
    received: int = 0
    rate_hz: float = 0.0
    unstamped: int = 0
    unreadable: int = 0
    delays: tuple[int, ...] = ()
    alike: tuple[str, ...] = ()
    largest: int = 0


@dataclass(frozen=True, slots=True)
class SeenOutput:
    """An output of the file, under its name in the graph, and the nodes that publish it, as far as they are named."""

    name: str
    nodes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Sighting:
    """The graph. `nodes` are all others in full, each as often as it is there.

    `n_topics` counts what is published, what every node has aside, and
    `n_nameless` those of them by nodes whose names did not arrive; `clocks` counts the publishers of /clock, `ticks`
    its messages.
    """

    seconds: float
    nodes: tuple[str, ...]
    n_topics: int
    n_nameless: int = 0
    topics: tuple[SeenTopic, ...] = ()
    clocks: int = 0
    ticks: int = 0
    outputs: tuple[SeenOutput, ...] = ()
