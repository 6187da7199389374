"""What the graph shows: its nodes and topics, and of a topic's endpoints why they do not connect to us."""

import os
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import Final

from syncrelay.config.names_in_graph import DIAGNOSTICS, MANIFEST_TYPE
from syncrelay.config.profile import Mismatch, Profile, mismatch
from syncrelay.environment.domain import range_of
from syncrelay.explain import Endpoint, GraphSnapshot
from syncrelay.printable import printable
from syncrelay.relay.ports import EndpointInfo, Graph, Node, NodeName

# Every node publishes these.
_OF_EVERY_NODE: Final = ("/parameter_events", "/rosout")
_CLOCK: Final = "/clock"
# Every managed node publishes this.
_STATE: Final = "/transition_event"
_STATE_TYPE: Final = "lifecycle_msgs/msg/TransitionEvent"
# How alike the names of two topics must be, as difflib measures it.
_ALIKE: Final = 0.5


def as_publishers(infos: Iterable[EndpointInfo], requested: Profile | None) -> tuple[Endpoint, ...]:
    """Return a topic's publishers, with why they cannot serve our subscription."""
    return _endpoints(infos, lambda offered: mismatch(offered, requested) if requested else None, "publisher")


def as_subscribers(infos: Iterable[EndpointInfo], offered: Profile) -> tuple[Endpoint, ...]:
    """Return a topic's subscribers, with why our publisher cannot serve them."""
    return _endpoints(infos, lambda requested: mismatch(offered, requested), "subscriber")


def _endpoints(
    infos: Iterable[EndpointInfo], why: Callable[[Profile], Mismatch | None], kind: str
) -> tuple[Endpoint, ...]:
    return tuple(
        Endpoint(
            owner(info, kind),
            printable(info.type),
            why(info.profile),
            is_named=info.is_named,
            gid=info.gid,
        )
        for info in infos
    )


def owner(info: EndpointInfo, kind: str) -> str:
    """Return the full name of the node that an endpoint belongs to, or what is known instead of this `kind` of it."""
    if not info.uses_ros:
        return f"a {kind} that uses DDS without ROS"
    return full_name(info.node_name, info.node_namespace) if info.is_named else f"a {kind} whose node is not known yet"


def others(infos: Iterable[EndpointInfo], *, than: str, own: int) -> tuple[Endpoint, ...]:
    """Return the publishers of other nodes than the one of this full name, which has so many `own` of them.

    Publishers beyond those belong to a second node of that name.
    """
    found = _endpoints(infos, lambda _: None, "publisher")
    namesakes = [replace(each, node=f"another node named {than}") for each in found if each.node == than]
    return (*(each for each in found if each.node != than), *namesakes[own:])


def full_name(name: str, namespace: str) -> str:
    """Return a node's full name, fit to be printed."""
    return printable(f"{namespace.rstrip('/')}/{name}")


def other_nodes(node: Node) -> tuple[str, ...]:
    """Return the full names of the other nodes, each as often as it is there, without those that hide from lists."""
    try:
        found = node.graph.nodes()
    except UnicodeDecodeError:
        return ("a node whose name is not UTF-8",)
    names = sorted(full_name(name, namespace) for name, namespace in found)
    shown = [name for name in names if not _is_hidden(name)]
    if node.name in shown:
        shown.remove(node.name)
    return tuple(shown)


def snapshot(node: Node) -> GraphSnapshot:
    """Return what the whole graph holds beside a node."""
    graph = node.graph
    published = published_topics(graph)
    return GraphSnapshot(
        domain=graph.domain,
        discovery_range=range_of(os.environ),
        nodes=other_nodes(node),
        n_topics=len(published),
        n_unreached=sum(not all(each.is_named for each in publishers) for publishers in published.values()),
        has_clock=_CLOCK in published,
    )


def published_topics(graph: Graph) -> dict[str, Sequence[EndpointInfo]]:
    """Return the topics with publishers, and those; but for hidden topics and those of every node."""
    shown = (name for name in topics_in(graph) if name not in _OF_EVERY_NODE and not _is_hidden(name))
    found = ((name, graph.publishers_of(name)) for name in shown)
    return {name: publishers for name, publishers in found if publishers}


def managed_nodes(node: Node) -> dict[str, bool]:
    """Return the full names of the other managed nodes, and whether they publish nothing yet beside their state."""
    states = (name for name, types in topics_in(node.graph).items() if _STATE_TYPE in types)
    names = (name.removesuffix(_STATE) for name in states if name.endswith(_STATE))
    found = {}
    for name in names:
        namespace, _, own = name.rpartition("/")
        published = node.graph.published_by(NodeName(own, namespace or "/")).keys()
        # The player of a recording publishes the states of nodes that are not here.
        if f"{name}{_STATE}" in published:
            found[name] = published <= {*_OF_EVERY_NODE, f"{name}{_STATE}"}
    found.pop(node.name, None)
    return found


def _is_hidden(name: str) -> bool:
    return any(part.startswith("_") for part in name.split("/"))


def topics_in(graph: Graph) -> dict[str, tuple[str, ...]]:
    """Return the topics of the graph and their types, fit to be printed."""
    return {name: tuple(map(printable, types)) for name, types in graph.topics().items()}


def is_relayed(graph: Graph, publisher: EndpointInfo, name: str) -> bool:
    """Whether a topic is a relay's output: its publisher subscribes to a topic of that type with which its name ends.

    A lazy group that sleeps subscribes to nothing: a node that publishes manifests is a relay too.
    """
    node = NodeName(publisher.node_name, publisher.node_namespace)
    subscribed, published = graph.subscribed_by(node), graph.published_by(node)
    tells_sets = re.compile(re.escape(f"{node.namespace.rstrip('/')}/{node.name}") + "/[^/]+/sets")
    return any(
        name != original and name.endswith(original) and publisher.type in types
        for original, types in subscribed.items()
    ) or (
        # Others publish that too.
        name != DIAGNOSTICS
        and any(MANIFEST_TYPE in types and tells_sets.fullmatch(topic) for topic, types in published.items())
    )


def topics_alike(name: str, type_name: str | None, topics: Iterable[tuple[str, Sequence[str]]]) -> tuple[str, ...]:
    """Return the topics of a type, None for any, whose names are most like one that nobody publishes, the best first.

    First come those of the same name in a namespace; where nothing is alike, the only one of that type.
    """
    of_type = [topic for topic, types in topics if type_name in (None, *types) and topic != name]
    in_namespaces = [topic for topic in of_type if topic.endswith(name)]
    alike = [*in_namespaces, *get_close_matches(name, of_type, n=3, cutoff=_ALIKE)]
    return tuple(dict.fromkeys(alike)) or tuple(of_type if type_name and len(of_type) == 1 else ())
