"""A look at the graph for a few seconds, with a hidden node that subscribes as the relay would."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.qos import QoSCompatibility, QoSProfile, ReliabilityPolicy, qos_check_compatible

from syncrelay.cdr import read_stamp
from syncrelay.config import TopicConfig
from syncrelay.config.wording import nearest
from syncrelay.errors import RosUnavailableError, TypeImportError
from syncrelay.printable import printable
from syncrelay.ros.graph import is_nameless, node_of, topics_in
from syncrelay.ros.hidden_node import join
from syncrelay.ros.qos import input_profile
from syncrelay.ros.sighting import SeenOutput, SeenPublisher, SeenTopic, Sighting
from syncrelay.ros.types import StampReader, import_type, stamp_reader

_NODE: Final = "_syncrelay_doctor"
_POLL_S: Final = 0.02
_OF_EVERY_NODE: Final = ("/parameter_events", "/rosout")
_CLOCK: Final = "/clock"
_CLOCK_TYPE: Final = "rosgraph_msgs/msg/Clock"
# Enough to see how far behind stamps are; all are counted.
_MOST_SAMPLED: Final = 2_000


def look(topics: Mapping[str, TopicConfig], *, outputs: Sequence[str], seconds: float, use_sim_time: bool) -> Sighting:
    """Join the graph and return what was seen of these topics and outputs, by their names in it, and of all others.

    Raises RosUnavailableError where rclpy does not start.
    """
    context = Context()
    node = None
    try:
        node = join(context, _NODE)
        return _watch(node, topics, outputs=outputs, seconds=seconds, use_sim_time=use_sim_time)
    except _rclpy.RCLError as error:
        raise RosUnavailableError(f"the graph cannot be looked at: {error}") from error
    finally:
        if node is not None:
            node.destroy_node()
        context.try_shutdown()


@dataclass(slots=True)
class _Watched:
    """A topic and what came of it so far."""

    name: str
    config: TopicConfig
    message_type: Any
    read_stamp: StampReader | None
    subscription: Any = None
    profile: QoSProfile | None = None
    arrivals: list[int] = field(default_factory=list)
    delays: list[int] = field(default_factory=list)
    unstamped: int = 0
    unreadable: int = 0
    largest: int = 0

    def take(self, payload: bytes, received: int, now: int | None) -> None:
        self.arrivals.append(received)
        self.largest = max(self.largest, len(payload))
        if self.read_stamp is None or len(self.delays) >= _MOST_SAMPLED:
            return
        stamp = self.read_stamp(payload)
        if stamp is None:
            self.unreadable += 1
        elif stamp == 0:
            self.unstamped += 1
        elif now is not None:
            self.delays.append(now - stamp - self.config.offset_ns)


class _Clock:
    """The time that stamps are held against: simulated time as /clock has it, None before its first message."""

    def __init__(self, node: Any, *, simulated: bool) -> None:
        self.ticks = 0
        self._now: int | None = None
        self._simulated = simulated
        profile = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
        message_type = import_type(_CLOCK_TYPE)
        self._subscription = node.create_subscription(message_type, _CLOCK, _never_called, profile, raw=True)

    def turn(self) -> None:
        for payload, _ in _drained(self._subscription):
            self.ticks += 1
            self._now = read_stamp(payload)

    def time_of(self, received: int) -> int | None:
        return self._now if self._simulated else received


def _watch(
    node: Any,
    topics: Mapping[str, TopicConfig],
    *,
    outputs: Sequence[str],
    seconds: float,
    use_sim_time: bool,
) -> Sighting:
    watched = [_watched(name, config) for name, config in topics.items()]
    clock = _Clock(node, simulated=use_sim_time)
    began = time.monotonic()
    while time.monotonic() < began + seconds:
        clock.turn()
        for topic in watched:
            _subscribe(node, topic)
            for payload, received in _drained(topic.subscription) if topic.subscription else ():
                topic.take(payload, received, clock.time_of(received))
        time.sleep(_POLL_S)
    listed = topics_in(node)
    published = [name for name in listed if name not in _OF_EVERY_NODE and _is_published(node, name)]
    return Sighting(
        seconds=time.monotonic() - began,
        nodes=tuple(_others(node)),
        n_topics=len(published),
        n_nameless=sum(1 for name in published if any(map(is_nameless, _publishers(node, name)))),
        topics=tuple(_seen(node, topic, listed) for topic in watched),
        outputs=tuple(SeenOutput(name, _named(_publishers(node, name))) for name in outputs),
        clocks=node.count_publishers(_CLOCK),
        ticks=clock.ticks,
    )


def _watched(name: str, config: TopicConfig) -> _Watched:
    try:
        message_type = import_type(config.type)
        return _Watched(name, config, message_type, stamp_reader(config.stamp, message_type))
    except TypeImportError:
        # Said by the trial; publishers are looked for all the same.
        return _Watched(name, config, None, None)


def _subscribe(node: Any, topic: _Watched) -> None:
    if topic.profile is not None:
        return
    offered = [each.qos_profile for each in _publishers(node, topic.name) if each.topic_type == topic.config.type]
    topic.profile = input_profile(topic.config.qos, offered) if offered else None
    if topic.profile is not None and topic.message_type is not None:
        topic.subscription = node.create_subscription(
            topic.message_type, topic.name, _never_called, topic.profile, raw=True
        )


def _drained(subscription: Any) -> Sequence[tuple[bytes, int]]:
    """Take all that has arrived, with the time DDS received it; no executor serves this node."""
    taken = []
    while (message := subscription.handle.take_message(subscription.msg_type, True)) is not None:  # noqa: FBT003
        payload, meta = message
        taken.append((payload, meta["received_timestamp"]))
    return taken


def _never_called(_: bytes) -> None:
    """Fill the place of the callback that rclpy wants."""


def _publishers(node: Any, name: str) -> Sequence[Any]:
    endpoints: Sequence[Any] = node.get_publishers_info_by_topic(name)
    return endpoints


def _seen(node: Any, topic: _Watched, listed: Mapping[str, Sequence[str]]) -> SeenTopic:
    publishers = _publishers(node, topic.name)
    return SeenTopic(
        name=topic.name,
        type=topic.config.type,
        publishers=tuple(_seen_publisher(each, topic) for each in publishers),
        received=len(topic.arrivals),
        rate_hz=_rate_hz(topic.arrivals),
        unstamped=topic.unstamped,
        unreadable=topic.unreadable,
        delays=tuple(topic.delays),
        alike=() if publishers else tuple(_alike(node, topic, listed)),
        largest=topic.largest,
    )


def _seen_publisher(endpoint: Any, topic: _Watched) -> SeenPublisher:
    offered = endpoint.qos_profile
    mismatch = None
    if topic.profile is not None and endpoint.topic_type == topic.config.type:
        compatibility, reason = qos_check_compatible(offered, topic.profile)
        mismatch = _in_words(reason) if compatibility == QoSCompatibility.ERROR else None
    return SeenPublisher(
        node=_name(endpoint),
        type=printable(endpoint.topic_type),
        offers=f"{_word(offered.reliability)}, {_word(offered.durability)}",
        mismatch=mismatch,
    )


def _name(endpoint: Any) -> str:
    return "" if is_nameless(endpoint) else node_of(endpoint)


def _named(endpoints: Sequence[Any]) -> tuple[str, ...]:
    return tuple(filter(None, map(_name, endpoints)))


def _word(policy: Any) -> str:
    return str(policy.name).lower()


def _in_words(reason: str) -> str:
    """Return rclpy's `ERROR: Best effort publisher and reliable subscription;WARNING: ...` as a part of a sentence."""
    errors = [part.removeprefix("ERROR: ") for part in reason.split(";") if part.startswith("ERROR: ")]
    return ", ".join(error[:1].lower() + error[1:] for error in errors)


def _rate_hz(arrivals: Sequence[int]) -> float:
    if len(arrivals) < 2 or arrivals[-1] <= arrivals[0]:  # noqa: PLR2004  a rate needs two
        return 0.0
    return (len(arrivals) - 1) * 1e9 / (arrivals[-1] - arrivals[0])


def _alike(node: Any, topic: _Watched, listed: Mapping[str, Sequence[str]]) -> Sequence[str]:
    """Return the nearest name that somebody publishes, and whatever else is of the wanted type: at most two."""
    published = [name for name in listed if _is_published(node, name) and not _is_hidden(name)]
    same_type = [name for name in published if topic.config.type in listed[name]]
    close = nearest(topic.name, same_type) or nearest(topic.name, published, likeness=0.8)
    return list(dict.fromkeys([*([close] if close else []), *same_type]))[:2]


def _is_published(node: Any, name: str) -> bool:
    return bool(node.count_publishers(name))


def _is_hidden(name: str) -> bool:
    return any(part.startswith("_") for part in name.split("/"))


def _others(node: Any) -> Sequence[str]:
    found = [printable(f"{namespace.rstrip('/')}/{name}") for name, namespace in node.get_node_names_and_namespaces()]
    return sorted(name for name in found if not name.endswith(f"/{_NODE}"))
