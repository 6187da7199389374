"""What the graph shows: its nodes and topics, and of a topic's endpoints why they do not connect to us."""

import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from difflib import get_close_matches
from typing import Any, Final

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import NodeNameNonExistentError
from rclpy.qos import QoSDurabilityPolicy, QoSLivelinessPolicy, QoSProfile, QoSReliabilityPolicy

from syncrelay.config.names import is_topic_name
from syncrelay.config.names_in_graph import DIAGNOSTICS, MANIFEST_TYPE
from syncrelay.environment.domain import range_of
from syncrelay.explain import Endpoint, GraphSnapshot, Mismatch
from syncrelay.printable import printable

_RELIABILITY: Final = {QoSReliabilityPolicy.BEST_EFFORT: "best_effort", QoSReliabilityPolicy.RELIABLE: "reliable"}
_DURABILITY: Final = {QoSDurabilityPolicy.VOLATILE: "volatile", QoSDurabilityPolicy.TRANSIENT_LOCAL: "transient_local"}
_LIVELINESS: Final = {
    QoSLivelinessPolicy.AUTOMATIC: "automatic",
    QoSLivelinessPolicy.MANUAL_BY_TOPIC: "manual_by_topic",
}
# rmw_dds_common gives this name to a node whose own name has not arrived.
_NAMELESS: Final = "_NODE_NAME_UNKNOWN_"
# Every node publishes these.
_OF_EVERY_NODE: Final = ("/parameter_events", "/rosout")
_CLOCK: Final = "/clock"
# How alike the names of two topics must be, as difflib measures it.
_ALIKE: Final = 0.5


def mismatch(offered: QoSProfile, requested: QoSProfile) -> Mismatch | None:
    """Return the first policy by which a publisher and a subscriber do not connect, None if they do.

    The rules are those of DDS 1.4, section 2.2.3: a publisher must offer at least what is requested.
    """
    for policy, ranks in (("reliability", _RELIABILITY), ("durability", _DURABILITY), ("liveliness", _LIVELINESS)):
        less, more = ranks
        if getattr(offered, policy) == less and getattr(requested, policy) == more:
            return Mismatch(policy, ranks[less], ranks[more])
    for policy in ("deadline", "liveliness_lease_duration"):
        offer, request = (_nanoseconds(getattr(profile, policy)) for profile in (offered, requested))
        if request and (not offer or offer > request):
            return Mismatch(policy, f"{offer / 1e6:g}ms" if offer else "none", f"{request / 1e6:g}ms")
    return None


def _nanoseconds(duration: Any) -> int:
    """Return a policy's duration, 0 where it is unset or without end."""
    nanoseconds = int(duration.nanoseconds)
    return 0 if nanoseconds >= 2**63 - 1 or nanoseconds < 0 else nanoseconds


def publishers(infos: Iterable[Any], requested: QoSProfile | None) -> tuple[Endpoint, ...]:
    """Return a topic's publishers, with why they cannot serve our subscription."""
    return _endpoints(infos, lambda qos: requested and mismatch(qos, requested), "publisher")


def subscribers(infos: Iterable[Any], offered: QoSProfile) -> tuple[Endpoint, ...]:
    """Return a topic's subscribers, with why our publisher cannot serve them."""
    return _endpoints(infos, lambda qos: mismatch(offered, qos), "subscriber")


def _endpoints(infos: Iterable[Any], why: Callable[[QoSProfile], Mismatch | None], kind: str) -> tuple[Endpoint, ...]:
    return tuple(
        Endpoint(
            f"a {kind} whose node is not known yet" if is_nameless(info) else _full_name(info),
            printable(info.topic_type),
            why(info.qos_profile),
            is_named=not is_nameless(info),
        )
        for info in infos
    )


def others(infos: Iterable[Any], *, than: str, own: int) -> tuple[Endpoint, ...]:
    """Return the publishers of other nodes than the one of this full name, which has so many `own` of them.

    Publishers beyond those belong to a second node of that name.
    """
    found = _endpoints(infos, lambda _: None, "publisher")
    namesakes = [replace(each, node=f"another node named {than}") for each in found if each.node == than]
    return (*(each for each in found if each.node != than), *namesakes[own:])


def is_nameless(info: Any) -> bool:
    """Whether DDS found an endpoint, but not yet the message that names its node."""
    return bool(info.node_name == _NAMELESS)


def _full_name(info: Any) -> str:
    return printable(f"{info.node_namespace.rstrip('/')}/{info.node_name}")


def other_nodes(node: Any) -> tuple[str, ...]:
    """Return the full names of the other nodes, each as often as it is there, without those that hide from lists."""
    try:
        found = node.get_node_names_and_namespaces()
    except UnicodeDecodeError:
        return ("a node whose name is not UTF-8",)
    names = sorted(printable(f"{namespace.rstrip('/')}/{name}") for name, namespace in found)
    shown = [name for name in names if not _is_hidden(name)]
    if (own := node.get_fully_qualified_name()) in shown:
        shown.remove(own)
    return tuple(shown)


def snapshot(node: Any) -> GraphSnapshot:
    """Return what the whole graph holds beside a node."""
    published = published_topics(node)
    return GraphSnapshot(
        domain=node.context.get_domain_id(),
        discovery_range=range_of(os.environ),
        nodes=other_nodes(node),
        n_topics=len(published),
        n_unreached=sum(any(map(is_nameless, node.get_publishers_info_by_topic(name))) for name in published),
        has_clock=_CLOCK in published,
    )


def published_topics(node: Any) -> dict[str, tuple[str, ...]]:
    """Return the topics with publishers, and their types; but for hidden ones and those of every node."""
    return {
        name: types
        for name, types in topics_in(node).items()
        if name not in _OF_EVERY_NODE and not _is_hidden(name) and node.count_publishers(name)
    }


def _is_hidden(name: str) -> bool:
    return any(part.startswith("_") for part in name.split("/"))


def topics_in(node: Any) -> dict[str, tuple[str, ...]]:
    """Return the topics of the graph and their types; but for names against ROS's rules, on which rclpy raises.

    DDS allows any name, and a publisher need not use ROS.
    """
    try:
        named = dict(node.get_topic_names_and_types())
    except UnicodeDecodeError:
        # If one name is not UTF-8, rclpy raises for the whole graph. Asked node by node, it raises for that node alone.
        named = dict(_topics_by_node(node))
    return {name: tuple(map(printable, types)) for name, types in named.items() if is_topic_name(name)}


def _topics_by_node(node: Any) -> Iterator[tuple[str, Sequence[str]]]:
    for name, namespace in node.get_node_names_and_namespaces():
        with suppress(NodeNameNonExistentError, UnicodeDecodeError):
            yield from node.get_publisher_names_and_types_by_node(name, namespace)


def is_relayed(node: Any, publisher: Any, name: str) -> bool:
    """Whether a topic is a relay's output: its publisher subscribes to a topic of that type with which its name ends.

    A lazy group that sleeps subscribes to nothing: a node that publishes manifests is a relay too.
    """
    named = publisher.node_name, publisher.node_namespace
    try:
        subscribed = node.get_subscriber_names_and_types_by_node(*named)
        published = node.get_publisher_names_and_types_by_node(*named)
    except (NodeNameNonExistentError, UnicodeDecodeError, _rclpy.RCLError):
        # RCLError: a name that ROS does not allow, as of a publisher without ROS, or one that has not arrived yet.
        return False
    tells_sets = re.compile(re.escape(f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}") + "/[^/]+/sets")
    return any(
        name != original and name.endswith(original) and publisher.topic_type in types for original, types in subscribed
    ) or (
        # Others publish that too.
        name != DIAGNOSTICS
        and any(MANIFEST_TYPE in types and tells_sets.fullmatch(topic) for topic, types in published)
    )


def topics_alike(name: str, type_name: str | None, topics: Iterable[tuple[str, Sequence[str]]]) -> tuple[str, ...]:
    """Return the topics of a type, None for any, whose names are most like one that nobody publishes, the best first.

    First come those of the same name in a namespace; where nothing is alike, the only one of that type.
    """
    of_type = [topic for topic, types in topics if type_name in (None, *types) and topic != name]
    in_namespaces = [topic for topic in of_type if topic.endswith(name)]
    alike = [*in_namespaces, *get_close_matches(name, of_type, n=3, cutoff=_ALIKE)]
    return tuple(dict.fromkeys(alike)) or tuple(of_type if type_name and len(of_type) == 1 else ())
