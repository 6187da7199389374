"""A node to look at the graph with: of those that `ros2 node list` hides, without services and topics of its own."""

import os
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions

from syncrelay.environment.domain import require_domain
from syncrelay.ros.environment import keep_stdout, log_arguments


def join(context: Context, name: str) -> Any:
    """Start rclpy in a context, signals left alone, and return a node; its name begins with an underscore.

    Raises RosUnavailableError where ROS_DOMAIN_ID names no domain.
    """
    require_domain(os.environ)
    keep_stdout()
    rclpy.init(
        args=["--ros-args", "--disable-stdout-logs", "--disable-rosout-logs", *log_arguments()],
        context=context,
        signal_handler_options=SignalHandlerOptions.NO,
    )
    return rclpy.create_node(
        name, context=context, use_global_arguments=False, start_parameter_services=False, enable_rosout=False
    )
