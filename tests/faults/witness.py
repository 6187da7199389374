"""A process that subscribes to a group's outputs and holds them to the law. Run as `python -m tests.faults.witness`.

It takes commands on stdin, one a line, and answers each with a line on stdout:

    match       a publisher is seen on every output
    report      what came and what is wrong with it, as a JSON object

It ends when stdin does.
"""

import argparse
import json
import select
import sys
import time
from typing import Any

import rclpy
from geometry_msgs.msg import Vector3Stamped
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_default_context

from syncrelay.ros.leaving import leave
from tests.faults.laws import SetLaw

_POLL_S = 0.01
# The number of files that wait for a command, and whether there is one, is looked at this often at least.
_TURN_NS = 20_000_000
# Commands are looked for after so many messages of one output.
_BATCH = 500


def main() -> None:
    arguments = _parser().parse_args()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(arguments.node, enable_rosout=False, start_parameter_services=False)
    profile = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy[arguments.reliability.upper()])
    topics, outputs = zip(*arguments.output, strict=True)
    subscriptions = [node.create_subscription(Vector3Stamped, each, print, profile, raw=True) for each in outputs]
    law = SetLaw(topics, slop=arguments.slop)
    wait_set = _rclpy.WaitSet(len(outputs), 0, 0, 0, 0, 0, rclpy.get_default_context().handle)
    while True:
        if select.select([sys.stdin], [], [], 0)[0]:
            command = sys.stdin.readline().strip()
            if not command:
                break
            while command == "match" and any(node.count_publishers(output) < 1 for output in outputs):
                time.sleep(_POLL_S)
            print(json.dumps(_report(law)), flush=True)  # noqa: T201  the answer
        wait_set.clear_entities()
        for subscription in subscriptions:
            wait_set.add_subscription(subscription.handle)
        wait_set.wait(_TURN_NS)
        for index, subscription in enumerate(subscriptions):
            if wait_set.is_ready("subscription", index):
                _drain(law, index, subscription.handle)
    leave(node, get_default_context())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", nargs=2, action="append", required=True, metavar=("INPUT", "OUTPUT"))
    parser.add_argument("--slop", type=int, required=True, help="in nanoseconds")
    parser.add_argument("--node", default="witness")
    parser.add_argument("--reliability", default="reliable")
    return parser


def _drain(law: SetLaw, index: int, handle: Any) -> None:
    for _ in range(_BATCH):
        taken = handle.take_message(Vector3Stamped, True)  # noqa: FBT003  rclpy's signature
        if taken is None:
            return
        law.take(index, taken[0])


def _report(law: SetLaw) -> dict[str, object]:
    return {
        "messages": law.messages,
        "sets": law.sets,
        "unpaired": law.unpaired,
        "last_set": law.last_set,
        "faults": law.faults,
    }


if __name__ == "__main__":
    main()
