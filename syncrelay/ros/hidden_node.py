"""Nodes that only look at the graph: hidden from `ros2 node list`, without services and topics of their own."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

import rclpy
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from syncrelay.config import Config
from syncrelay.errors import RosUnavailableError
from syncrelay.ros.leaving import leave
from syncrelay.ros.start import make_node, resolver, start

OBSERVER: Final = "_syncrelay_observer"
"""The name of a node that observes."""
# The first two override the third.
_DISCOVERY: Final = ("ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS", "ROS_AUTOMATIC_DISCOVERY_RANGE")


def _hidden(context: Context, name: str, *, namespace: str = "", arguments: Sequence[str] = ()) -> Any:
    """Return a node in a context of `_started`; its name begins with an underscore."""
    return rclpy.create_node(
        name,
        namespace=namespace,
        context=context,
        cli_args=["--ros-args", *arguments],
        use_global_arguments=False,
        start_parameter_services=False,
        enable_rosout=False,
    )


def _started() -> Context:
    return start(["--disable-rosout-logs"], simulated=False)


def join_hidden(config: Config, ros_args: Sequence[str]) -> tuple[Context, Any, str]:
    """Return a hidden node with the remaps and the time of the relay's node, its context, and the relay's full name.

    ROS arguments may address the relay's node by name. So a node of that name, which nobody can find, is asked what
    they mean.

    Raises UsageError where ROS does not take the arguments, RosUnavailableError where it does not start.
    """
    with _undiscovered():
        context = start(ros_args, simulated=config.node.use_sim_time)
        try:
            node = make_node(config.node.name, namespace=config.node.namespace, context=context, ros_args=ros_args)
            resolve = resolver(node, ros_args)
            remaps = [word for name in config.names.written for word in ("-r", f"{name}:={resolve(name)}")]
            is_simulated = str(node.get_parameter("use_sim_time").value).lower()
            name, namespace = node.get_fully_qualified_name(), node.get_namespace()
            node.destroy_node()
        finally:
            context.try_shutdown()
    hidden = _started()
    arguments = ["-p", f"use_sim_time:={is_simulated}", *remaps]
    return hidden, _hidden(hidden, OBSERVER, namespace=namespace, arguments=arguments), name


@contextmanager
def hidden_node(name: str) -> Iterator[Any]:
    """Join the graph with a hidden node, and leave it; raises RosUnavailableError where rclpy does not start."""
    context, node = _started(), None
    try:
        node = _hidden(context, name)
        yield node
    except _rclpy.RCLError as error:
        raise RosUnavailableError(f"cannot look at the graph: {error}") from error
    finally:
        leave(node, context)


@contextmanager
def _undiscovered() -> Iterator[None]:
    """Have nodes that start meanwhile find nobody, and nobody find them."""
    before = {name: os.environ.pop(name) for name in _DISCOVERY if name in os.environ}
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "OFF"
    try:
        yield
    finally:
        del os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"]
        os.environ.update(before)
