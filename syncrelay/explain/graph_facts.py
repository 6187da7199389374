"""What the graph shows around a group: endpoints and what is wrong with them, who sends, what DDS refuses."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from syncrelay.config.profile import Mismatch, Profile


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A publisher of an input or a subscriber of an output: its node, its type, why it does not connect to us.

    `is_named` is False where DDS has found the endpoint but not yet its node; `node` then says so. `gid` tells it from
    all others, empty where nothing does.
    """

    node: str
    type: str
    mismatch: Mismatch | None = None
    is_named: bool = True
    gid: bytes = field(default=b"", compare=False, repr=False)


@dataclass(slots=True)  # frozen, it would cost three times as much to make, at each look
class Sender:
    """A node that publishes an input, and how many of its messages came lately, by the numbers that they have.

    What it published before the relay had found it is not counted. `longest_gap` is the most that did not come in a
    row, `sent_hz` the rate at which it sent the last ones by its own clock, None of too few, `way` the least time in
    nanoseconds from their publication to their receipt, by two clocks if it runs on another machine. `sent_in_all` and
    `delivered_in_all` are counted since the relay follows the topic.
    """

    node: str
    sent: int
    delivered: int
    longest_gap: int = 0
    sent_hz: float | None = None
    way: int | None = None
    sent_in_all: int = 0
    delivered_in_all: int = 0

    @property
    def lost(self) -> int:
        """How many did not come."""
        return self.sent - self.delivered


@dataclass(frozen=True, slots=True)
class GraphSnapshot:
    """The whole graph at one moment. `nodes` are the full names of all other nodes, each as often as it is there.

    `discovery_range` is ROS_AUTOMATIC_DISCOVERY_RANGE as rcl reads it. `n_topics` counts the topics with publishers,
    `n_unreached` those of them with a publisher whose node is not known.
    """

    domain: int
    discovery_range: str
    nodes: tuple[str, ...] = ()
    n_topics: int = 0
    n_unreached: int = 0
    has_clock: bool = False


@dataclass(frozen=True, slots=True)
class Refusal:
    """A publisher or subscription that DDS does not make.

    `verb` is what cannot be done with the topic. `held_as` is the type that this process has the topic as already,
    where that is the reason; else `why` is what DDS says, or, where it `is_unfit`, why a bundle cannot be of the type.
    """

    verb: str
    topic: str
    type: str
    held_as: str | None = None
    why: str = ""
    is_unfit: bool = False

    @property
    def text(self) -> str:
        """The whole in words."""
        return f"the relay cannot {self.verb} {self.topic} as {self.type}: {self.reason}"

    @property
    def reason(self) -> str:
        """Why, in words."""
        return f"this process has it as {self.held_as} already" if self.held_as else self.why


@dataclass(slots=True)  # frozen, it would cost three times as much to make, at each look
class InputGraph:
    """What the graph shows around an input; a recording shows no more than that it was published.

    `name` is the topic's in the graph, `output` that under which its messages leave, `not_importable` says why its type
    cannot be used here, `not_readable` why the stamp or key that the file names cannot be read from it, `refusal` what
    DDS does not make or publish for it, `alike` are topics of the graph that may have been meant, `managed` those of
    its publishers that are managed nodes, or, of none, the managed nodes that publish nothing yet. DDS recently lost
    `lost` messages on the way, and `lost_in_all` since the relay follows the topic. `senders` are those that publish
    it, by their nodes, none where messages do not say whose they are. `profile` is what the relay subscribes with.
    `type_from` is the publisher, or one of several, whose type was taken because the file has none, None while there is
    none. `rivals` are others that publish its output, seen so without a break since `rivals_since`. `largest` is the
    size of the largest message in bytes, 0 where nobody measures it.
    """

    name: str
    output: str
    publishers: tuple[Endpoint, ...] = ()
    subscribers: tuple[Endpoint, ...] = ()
    alike: tuple[str, ...] = ()
    managed: tuple[str, ...] = ()
    not_importable: str | None = None
    not_readable: str | None = None
    refusal: Refusal | None = None
    lost: int = 0
    lost_in_all: int = 0
    rivals: tuple[Endpoint, ...] = ()
    rivals_since: int = 0
    largest: int = 0
    type_from: Endpoint | None = None
    senders: tuple[Sender, ...] = ()
    profile: Profile | None = None

    @property
    def undelivered(self) -> int:
        """How many messages did not come lately: by their numbers, or else by what DDS reports."""
        return sum(each.lost for each in self.senders) if any(each.sent for each in self.senders) else self.lost

    @property
    def sent_hz(self) -> float | None:
        """The rate at which its publishers sent the last messages; None where that is not known."""
        sending = [each for each in self.senders if each.sent]
        rates = [each.sent_hz for each in sending if each.sent_hz is not None]
        return sum(rates) if rates and len(rates) == len(sending) else None


def serving(graph: InputGraph, type_name: str | None) -> Sequence[Endpoint]:
    """Return the publishers whose messages an input of this type can receive."""
    return [each for each in graph.publishers if each.type == type_name and not each.mismatch]


class BundleGraph(NamedTuple):
    """What the graph shows around the topic on which the sets of a group leave as one message each.

    `is_alone` says that they leave in no other way, `refusal` why they do not leave in this one. The others are as
    those of InputGraph.
    """

    name: str
    is_alone: bool = False
    refusal: Refusal | None = None
    subscribers: tuple[Endpoint, ...] = ()
    rivals: tuple[Endpoint, ...] = ()
    rivals_since: int = 0
