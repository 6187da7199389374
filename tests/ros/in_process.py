"""A node of the test's own process."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import rclpy


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
