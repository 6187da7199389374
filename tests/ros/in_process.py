"""A node of the test's own process."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import rclpy
from geometry_msgs.msg import Vector3Stamped
from rclpy.qos import HistoryPolicy, QoSProfile

from syncrelay.dataflow.backend import ALL
from syncrelay.ros.backend_choice import choose_backend

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
