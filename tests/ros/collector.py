"""A process that subscribes and writes down every payload it gets. Run as `python -m tests.ros.collector`.

Payloads go to the file of `--output` in the order of their arrival, as frames.py writes them. It takes
commands on stdin, one a line, and answers each with a line on stdout:

    endpoints TOPIC     what the graph shows on TOPIC, as a JSON list of objects
    nodes               the full names of all nodes, as a JSON list

It ends when stdin does.
"""

import argparse
import functools
import json
import sys
import threading
import time
from pathlib import Path
from typing import BinaryIO

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.utilities import get_default_context

from syncrelay.ros.environment import keep_stdout
from syncrelay.ros.leaving import leave
from tests.ros import frames
from tests.ros.message_types import import_type


def main() -> None:
    arguments = _parser().parse_args()
    # Fast DDS's own lines would be taken for answers.
    keep_stdout()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(arguments.node)
    profile = QoSProfile(
        history=HistoryPolicy.KEEP_ALL,
        reliability=ReliabilityPolicy[arguments.reliability.upper()],
        durability=DurabilityPolicy[arguments.durability.upper()],
    )
    with arguments.output.open("wb", buffering=0) as output:
        for topic, type_name in arguments.topic:
            write = functools.partial(_write, output, topic, type_name)
            node.create_subscription(import_type(type_name), topic, write, profile, raw=True)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        spinning = threading.Thread(target=_spin, args=(executor,))
        spinning.start()
        for line in sys.stdin:
            print(json.dumps(_answer(node, line.split())), flush=True)  # noqa: T201  the answer
        # Shut down first, the executor would wait forever where it was just about to.
        rclpy.shutdown()
        spinning.join()
        leave(node, get_default_context())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--topic", nargs=2, action="append", default=[], metavar=("NAME", "TYPE"))
    parser.add_argument("--node", default="collector")
    parser.add_argument("--reliability", default="reliable")
    parser.add_argument("--durability", default="volatile")
    return parser


def _write(output: BinaryIO, topic: str, type_name: str, payload: bytes) -> None:
    frames.append(output, frames.Frame(topic, type_name, time.time_ns(), payload))


def _spin(executor: SingleThreadedExecutor) -> None:
    try:
        executor.spin()
    except ExternalShutdownException:
        return


def _answer(node: Node, command: list[str]) -> list[object]:
    if command[0] == "nodes":
        names = node.get_node_names_and_namespaces()
        return [f"{namespace.rstrip('/')}/{name}" for name, namespace in names]
    publishers = node.get_publishers_info_by_topic(command[1])
    subscriptions = node.get_subscriptions_info_by_topic(command[1])
    return [_endpoint(info) for info in [*publishers, *subscriptions]]


def _endpoint(info: TopicEndpointInfo) -> dict[str, str]:
    return {
        "node": f"{info.node_namespace.rstrip('/')}/{info.node_name}",
        "kind": info.endpoint_type.name.lower(),
        "type": info.topic_type,
        "reliability": info.qos_profile.reliability.name.lower(),
        "durability": info.qos_profile.durability.name.lower(),
    }


if __name__ == "__main__":
    main()
