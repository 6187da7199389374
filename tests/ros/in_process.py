"""A node of the test's own process."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import rclpy
from geometry_msgs.msg import Vector3Stamped
from rclpy.qos import HistoryPolicy, QoSProfile

from syncrelay.config import Config
from syncrelay.dataflow.backend import ALL
from syncrelay.relay.relay import Relay
from syncrelay.ros.backend_choice import choose_backend
from syncrelay.ros.joining import joined as joined_by
from syncrelay.ros.node import RosNode

_KEEP_ALL = QoSProfile(history=HistoryPolicy.KEEP_ALL)


def joined(name: str, *, domain: int, environment: Mapping[str, str], **keys: Any) -> tuple[Any, Any]:
    """A context and a node on a domain; `environment` is what DDS is to find as it starts."""
    context = rclpy.context.Context()
    with patch.dict(os.environ, environment):
        rclpy.init(context=context, domain_id=domain, args=["--ros-args", "--disable-external-lib-logs"])
        return context, rclpy.create_node(name, context=context, **keys)


@contextmanager
def own_node(domain: int, name: str = "here", **keys: Any) -> Iterator[SimpleNamespace]:
    """A node that is found on this machine alone, and its context."""
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    context, node = joined(name, domain=domain, environment=environment, **keys)
    try:
        yield SimpleNamespace(node=node, context=context)
    finally:
        node.destroy_node()
        context.try_shutdown()


def port_of(node: Any) -> RosNode:
    """A node of rclpy, as the relay takes it."""
    return RosNode(node, relay_name=node.get_fully_qualified_name(), resolve=node.resolve_topic_name)


def own_relay(config: Config, *, ros_args: Sequence[str] = (), **keys: Any) -> Relay:
    """A relay in this process."""
    return Relay(config, *joined_by(config, ros_args=ros_args), **keys)


def vectors_on(node: Any, name: str, profile: QoSProfile = _KEEP_ALL) -> SimpleNamespace:
    """A topic of vectors with a raw subscription and a publisher."""
    subscription = node.create_subscription(Vector3Stamped, name, print, profile, raw=True)
    return SimpleNamespace(subscription=subscription, publisher=node.create_publisher(Vector3Stamped, name, profile))


@contextmanager
def own_backend(domain: int, backend: str) -> Iterator[SimpleNamespace]:
    """A node of this process, the backend as it proved itself on it, and three topics."""
    with own_node(domain) as own:
        own.backend = choose_backend(backend, node=own.node, context=own.context)
        own.topics = [vectors_on(own.node, f"/t{n}") for n in range(3)]
        yield own


def take(source: Any) -> Any:
    """The oldest message of a source, whether DDS reported it or not."""
    source.pending = ALL
    return source.take()
