"""What the graph shows of a topic's endpoints: nodes, types, and why they do not connect to us."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from difflib import get_close_matches
from typing import Any, Final

from rclpy.node import NodeNameNonExistentError
from rclpy.qos import QoSDurabilityPolicy, QoSLivelinessPolicy, QoSProfile, QoSReliabilityPolicy

from syncrelay.config.names import is_topic_name
from syncrelay.explain import Endpoint, Mismatch
from syncrelay.printable import printable

_RELIABILITY: Final = {QoSReliabilityPolicy.BEST_EFFORT: "best_effort", QoSReliabilityPolicy.RELIABLE: "reliable"}
_DURABILITY: Final = {QoSDurabilityPolicy.VOLATILE: "volatile", QoSDurabilityPolicy.TRANSIENT_LOCAL: "transient_local"}
_LIVELINESS: Final = {
    QoSLivelinessPolicy.AUTOMATIC: "automatic",
    QoSLivelinessPolicy.MANUAL_BY_TOPIC: "manual_by_topic",
}
# What rmw_dds_common has in the place of a name that did not arrive.
_NAMELESS: Final = "_NODE_NAME_UNKNOWN_"
# In a namespace of its own a sensor has the same last words.
_ALIKE: Final = 0.5


def mismatch(offered: QoSProfile, requested: QoSProfile) -> Mismatch | None:
    """Return the first policy by which a publisher and a subscriber do not connect, None if they do.

    The rules are DDS's: who offers more than is requested is fit (DDS 1.4, section 2.2.3).
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
    return _endpoints(infos, lambda qos: requested and mismatch(qos, requested))


def subscribers(infos: Iterable[Any], offered: QoSProfile) -> tuple[Endpoint, ...]:
    """Return a topic's subscribers, with why our publisher cannot serve them."""
    return _endpoints(infos, lambda qos: mismatch(offered, qos))


def _endpoints(infos: Iterable[Any], why: Callable[[QoSProfile], Mismatch | None]) -> tuple[Endpoint, ...]:
    return tuple(Endpoint(node_of(info), printable(info.topic_type), why(info.qos_profile)) for info in infos)


def others(infos: Iterable[Any], *, than: str, own: int) -> tuple[Endpoint, ...]:
    """Return the endpoints of other nodes than the one of this full name, which has so many `own` of them.

    What has its name and is not among those is of a second node of that name.
    """
    found = _endpoints(infos, lambda _: None)
    namesakes = [replace(each, node=f"another node of the name {than}") for each in found if each.node == than]
    return (*(each for each in found if each.node != than), *namesakes[own:])


def is_nameless(info: Any) -> bool:
    """Whether DDS found an endpoint, but not yet the message that tells its node."""
    return bool(info.node_name == _NAMELESS)


def node_of(info: Any) -> str:
    """Return the full name of an endpoint's node."""
    if is_nameless(info):
        return "a node of unknown name"
    return printable(f"{info.node_namespace.rstrip('/')}/{info.node_name}")


def topics_in(node: Any) -> dict[str, tuple[str, ...]]:
    """Return the topics of the graph and their types; but for names against ROS's rules, on which rclpy raises.

    DDS allows any, and who publishes there need not use ROS.
    """
    try:
        named = dict(node.get_topic_names_and_types())
    except UnicodeDecodeError:
        # One name that is no UTF-8 hides all from rclpy; node by node, it hides those of its node.
        named = dict(_topics_by_node(node))
    return {name: tuple(map(printable, types)) for name, types in named.items() if is_topic_name(name)}


def _topics_by_node(node: Any) -> Iterator[tuple[str, Sequence[str]]]:
    for name, namespace in node.get_node_names_and_namespaces():
        with suppress(NodeNameNonExistentError, UnicodeDecodeError):
            yield from node.get_publisher_names_and_types_by_node(name, namespace)


def topics_alike(name: str, type_name: str, topics: Iterable[tuple[str, Sequence[str]]]) -> tuple[str, ...]:
    """Return the topics of a type whose names are most like one that nobody publishes; all graph names, best first."""
    of_type = [topic for topic, types in topics if type_name in types and topic != name]
    return tuple(get_close_matches(name, of_type, n=3, cutoff=_ALIKE)) or tuple(of_type if len(of_type) == 1 else ())
