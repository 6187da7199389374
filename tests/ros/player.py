"""A process with one raw publisher per topic. Run as `python -m tests.ros.player`.

It takes commands on stdin, one a line, and answers each with a line on stdout when it is done:

    match N             every publisher has at least N matched subscriptions
    play SPEED FILE     the frames of FILE were published, paced by their times; where SPEED is `clock`, at these
                        times by the machine's clock
    stop                what it plays was ended

It ends when stdin does, also in the midst of what it plays.
"""

import argparse
import os
import select
import sys
import time
from pathlib import Path

import rclpy
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_default_context

from syncrelay.ros.environment import keep_stdout
from syncrelay.ros.leaving import leave
from tests.ros import frames
from tests.ros.message_types import import_type

_POLL_S = 0.01
_LONGEST_SLEEP_S = 0.1
_DEPTH = 20_000


def main() -> None:
    arguments = _parser().parse_args()
    # Fast DDS's own lines would be taken for answers.
    keep_stdout()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(arguments.node)
    profile = QoSProfile(
        depth=_DEPTH,
        reliability=ReliabilityPolicy[arguments.reliability.upper()],
        durability=DurabilityPolicy[arguments.durability.upper()],
    )
    publishers = {
        topic: node.create_publisher(import_type(type_name), topic, profile) for topic, type_name in arguments.topic
    }
    # Without a buffer, which would hold the next command where nothing tells of it.
    stdin = os.fdopen(sys.stdin.fileno(), "rb", buffering=0, closefd=False)
    for line in iter(stdin.readline, b""):
        command, *words = line.decode().split(maxsplit=2)
        if command == "match":
            _match(publishers, int(words[0]))
        elif command == "play":
            _play(publishers, words[0], Path(words[1].rstrip("\n")))
        print(command, flush=True)  # noqa: T201  the answer
    leave(node, get_default_context())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--topic", nargs=2, action="append", required=True, metavar=("NAME", "TYPE"))
    parser.add_argument("--node", default="player")
    parser.add_argument("--reliability", default="reliable")
    parser.add_argument("--durability", default="volatile")
    return parser


def _is_interrupted() -> bool:
    """Whether there is another command, or nobody any more to give one."""
    return bool(select.select([sys.stdin], [], [], 0)[0])


def _match(publishers: dict[str, Publisher], subscriptions: int) -> None:
    while any(publisher.get_subscription_count() < subscriptions for publisher in publishers.values()):
        if _is_interrupted():
            return
        time.sleep(_POLL_S)


def _play(publishers: dict[str, Publisher], pace: str, path: Path) -> None:
    recording = frames.read(path)
    began, speed = time.monotonic(), 1.0 if pace == "clock" else float(pace)
    if pace == "clock":
        began += (recording[0].time - time.time_ns()) / 1e9
    for frame in recording:
        due = began + (frame.time - recording[0].time) / 1e9 / speed
        while (left := due - time.monotonic()) > 0:
            time.sleep(min(left, _LONGEST_SLEEP_S))
            if _is_interrupted():
                return
        publishers[frame.topic].publish(frame.payload)


if __name__ == "__main__":
    main()
