"""A node of the test's own process."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import rclpy


@contextmanager
def own_node(domain: int) -> Iterator[SimpleNamespace]:
    """A node on a domain, and its context."""
    context = rclpy.context.Context()
    rclpy.init(context=context, domain_id=domain, args=["--ros-args", "--disable-external-lib-logs"])
    node: Any = rclpy.create_node("here", context=context)
    try:
        yield SimpleNamespace(node=node, context=context)
    finally:
        node.destroy_node()
        context.try_shutdown()
