"""A process that publishes certified messages. Run as `python -m tests.faults.source`.

The n-th messages of all topics are stamped n periods after the epoch and a little, up to `--jitter`, so that sources
that know nothing of each other send what belongs together. It takes commands on stdin, one a line, and answers each
with a line on stdout:

    match N     every publisher has at least N matched subscriptions
    pace HZ     publish so many messages a second on every topic from now on; 0: none. A pace that cannot be held is
                as fast as it goes
    count       how many messages were published on each topic, as a JSON list
    settle      all that was published is acknowledged, or went to someone who is gone

It ends when stdin does.
"""

import argparse
import json
import select
import sys
import time
from collections.abc import Sequence

import rclpy
from geometry_msgs.msg import Vector3Stamped
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_default_context

from syncrelay.ros.leaving import leave
from tests.faults.certified import certified

_POLL_S = 0.01
_SETTLE = Duration(seconds=60)
# Commands are looked for at least so often while the pace cannot be held.
_BATCH = 200


def main() -> None:
    arguments = _parser().parse_args()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(arguments.node, enable_rosout=False, start_parameter_services=False)
    profile = QoSProfile(depth=arguments.depth, reliability=ReliabilityPolicy[arguments.reliability.upper()])
    publishers = [node.create_publisher(Vector3Stamped, topic, profile) for topic in arguments.topic]
    _serve(_Flow(arguments.topic, publishers, jitter=arguments.jitter))
    leave(node, get_default_context())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--topic", action="append", required=True)
    parser.add_argument("--node", default="source")
    parser.add_argument("--reliability", default="reliable")
    parser.add_argument("--depth", type=int, default=20_000)
    parser.add_argument("--jitter", type=int, default=0, help="in nanoseconds")
    return parser


class _Flow:
    """Messages at a pace."""

    def __init__(self, topics: Sequence[str], publishers: Sequence[Publisher], *, jitter: int) -> None:
        self.publishers = publishers
        self.counts = [0] * len(topics)
        self._topics = topics
        self._jitter = jitter
        self._period: int | None = None
        self._number = 0

    def set_pace(self, hz: float) -> None:
        self._period = round(1e9 / hz) if hz else None
        if self._period is not None:
            self._number = time.time_ns() // self._period + 1

    def wait(self) -> float | None:
        """Seconds until the next messages are due; None if none are."""
        if self._period is None:
            return None
        return max(0.0, (self._number * self._period - time.time_ns()) / 1e9)

    def publish(self) -> None:
        """Publish what is due, a batch at most."""
        if self._period is None:
            return
        for _ in range(_BATCH):
            due = self._number * self._period
            if due > time.time_ns():
                return
            for place, publisher in enumerate(self.publishers):
                late = (self._number * 7919 + place * 104_729) % (self._jitter + 1)
                publisher.publish(certified(self._topics[place], due + late))
                self.counts[place] += 1
            self._number += 1


def _serve(flow: _Flow) -> None:
    while True:
        ready, _, _ = select.select([sys.stdin], [], [], flow.wait())
        flow.publish()
        if not ready:
            continue
        command, *words = sys.stdin.readline().split() or [""]
        if not command:
            return
        print(json.dumps(_answer(flow, command, words)), flush=True)  # noqa: T201  the answer


def _answer(flow: _Flow, command: str, words: Sequence[str]) -> object:
    match command:
        case "match":
            while any(publisher.get_subscription_count() < int(words[0]) for publisher in flow.publishers):
                time.sleep(_POLL_S)
        case "pace":
            flow.set_pace(float(words[0]))
        case "settle":
            return all(publisher.wait_for_all_acked(_SETTLE) for publisher in flow.publishers)
    return flow.counts


if __name__ == "__main__":
    main()
