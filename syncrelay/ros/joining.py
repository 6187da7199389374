"""Joins the ROS graph: with the node of a file, to relay or observe; or with a hidden one, to listen or look."""

import os
import time
from collections.abc import Sequence
from typing import Final

import rclpy

from syncrelay.config import Config
from syncrelay.config.interfaces import Interfaces
from syncrelay.dataflow.backend import RclBackend
from syncrelay.environment.transport import apply_transport
from syncrelay.explain import GraphSnapshot
from syncrelay.relay.graph import snapshot
from syncrelay.relay.listening import Heard, Listener
from syncrelay.relay.ports import Purpose
from syncrelay.ros.backend_choice import VARIABLE, choose_backend
from syncrelay.ros.hidden_node import OBSERVER, hidden_node, join_hidden
from syncrelay.ros.node import RosNode
from syncrelay.ros.start import make_node, resolver, start

_LISTENER: Final = "_syncrelay_init"


def joined(
    config: Config, *, ros_args: Sequence[str] = (), purpose: Purpose = Purpose.RELAY, is_managed: bool = False
) -> tuple[RosNode, RclBackend]:
    """Join the graph with the node of a file; return it, and the backend that messages pass through.

    One that only observes is hidden from lists of nodes. Raises UsageError where ROS rejects `ros_args`,
    RosUnavailableError where it does not start.
    """
    apply_transport(config.node.transport, os.environ)
    make = rclpy.create_node
    if is_managed:
        from syncrelay.ros.lifecycle import ManagedNode  # noqa: PLC0415  few relays are managed

        make = ManagedNode
    if purpose is Purpose.OBSERVE:
        context, raw, relay_name = join_hidden(config, ros_args)
    else:
        context = start(ros_args, simulated=config.node.use_sim_time)
        raw = make_node(
            config.node.name,
            namespace=config.node.namespace,
            context=context,
            ros_args=ros_args,
            make=make,
        )
        relay_name = raw.get_fully_qualified_name()
    node = RosNode(raw, relay_name=relay_name, resolve=resolver(raw, ros_args))
    try:
        return node, choose_backend(os.environ.get(VARIABLE), node=raw, context=context)
    except BaseException:
        node.leave()
        raise


def listen(*, seconds: float) -> Heard:
    """Join the graph and return what came in a time; raises RosUnavailableError where rclpy does not start."""
    with hidden_node(_LISTENER) as raw:
        backend = choose_backend(os.environ.get(VARIABLE), node=raw, context=raw.context)
        node = RosNode(raw, relay_name=raw.get_fully_qualified_name(), resolve=raw.resolve_topic_name)
        return Listener(node, backend, seconds=seconds, interfaces=Interfaces.find(os.environ)).run()


def watch_graph(*, seconds: float) -> GraphSnapshot:
    """Join the graph for a time and return what it holds. Raises RosUnavailableError where rclpy does not start."""
    with hidden_node(OBSERVER) as raw:
        time.sleep(seconds)
        return snapshot(RosNode(raw, relay_name=raw.get_fully_qualified_name(), resolve=raw.resolve_topic_name))
