"""The graph as a node of rclpy sees it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import NodeNameNonExistentError

from syncrelay.config.names import is_topic_name
from syncrelay.dataflow.deliveries import GID_BYTES
from syncrelay.relay.ports import EndpointInfo, NodeName
from syncrelay.ros.qos import from_rclpy

# rmw_dds_common gives this name to a node whose own name has not arrived.
_NAMELESS: Final = "_NODE_NAME_UNKNOWN_"
# And this to what no node of ROS has made.
_WITHOUT_ROS: Final = "_CREATED_BY_BARE_DDS_APP_"


class RosGraph:
    """What a node of rclpy sees of the graph."""

    def __init__(self, raw: Any) -> None:
        self._raw = raw

    @property
    def domain(self) -> int:
        return int(self._raw.context.get_domain_id())

    def nodes(self) -> Sequence[NodeName]:
        return [NodeName(*each) for each in self._raw.get_node_names_and_namespaces()]

    def topics(self) -> Mapping[str, Sequence[str]]:
        """Names against ROS's rules are left out: rclpy raises on them, though a publisher need not use ROS."""
        try:
            named = dict(self._raw.get_topic_names_and_types())
        except UnicodeDecodeError:
            # If one name is not UTF-8, rclpy raises for the whole graph. Asked node by node, for that node alone.
            named = dict(self._topics_by_node())
        return {name: types for name, types in named.items() if is_topic_name(name)}

    def _topics_by_node(self) -> Iterator[tuple[str, Sequence[str]]]:
        for node in self.nodes():
            yield from self.published_by(node).items()

    def publishers_of(self, topic: str) -> Sequence[EndpointInfo]:
        return [_info(each) for each in self._raw.get_publishers_info_by_topic(topic)]

    def subscribers_of(self, topic: str) -> Sequence[EndpointInfo]:
        return [_info(each) for each in self._raw.get_subscriptions_info_by_topic(topic)]

    def published_by(self, node: NodeName) -> Mapping[str, Sequence[str]]:
        return _asked(self._raw.get_publisher_names_and_types_by_node, node)

    def subscribed_by(self, node: NodeName) -> Mapping[str, Sequence[str]]:
        return _asked(self._raw.get_subscriber_names_and_types_by_node, node)


def _asked(ask: Callable[[str, str], Sequence[tuple[str, Sequence[str]]]], node: NodeName) -> dict[str, Sequence[str]]:
    try:
        return dict(ask(*node))
    except (NodeNameNonExistentError, UnicodeDecodeError, _rclpy.RCLError):
        # RCLError: a name that ROS does not allow, as of a publisher without ROS, or one that has not arrived yet.
        return {}


def _info(raw: Any) -> EndpointInfo:
    return EndpointInfo(
        raw.node_name,
        raw.node_namespace,
        raw.topic_type,
        from_rclpy(raw.qos_profile),
        is_named=raw.node_name != _NAMELESS,
        uses_ros=raw.node_name != _WITHOUT_ROS,
        gid=bytes(raw.endpoint_gid[:GID_BYTES]),
        type_hash=str(raw.topic_type_hash) if raw.topic_type_hash.version > 0 else "",
    )
