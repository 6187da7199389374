"""Joins the outputs of a syncrelay group into its sets, by the group's manifest (docs/reference/manifest.md).

python3 join_sets.py /syncrelay/front/sets /front/image sensor_msgs/msg/Image /front/imu sensor_msgs/msg/Imu

prints a line of JSON for each set: its number, and of each output the stamp of its message, null for a missing one.
"""

import importlib
import json
import sys
from collections import deque
from contextlib import suppress
from functools import partial

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import ExternalShutdownException

KEEP = 500


class SetJoiner:
    """Takes messages and manifests as they come, and gives `take(number, {output: message or None})` each whole set."""

    def __init__(self, outputs, take):
        self.take = take
        # Of each output its messages by their sequence numbers.
        self.held: dict[str, dict] = {output: {} for output in outputs}
        self.manifests: deque = deque(maxlen=KEEP)
        self.number = 0

    def add_message(self, output, message, info):
        held, sequence = self.held[output], info["publication_sequence_number"]
        if held and sequence <= next(reversed(held)):  # The relay has begun again.
            held.clear()
            self.manifests.clear()
        held[sequence] = message
        if len(held) > KEEP:
            del held[next(iter(held))]
        self.join()

    def add_manifest(self, manifest):
        of_set, *inputs = [(each.name, {pair.key: pair.value for pair in each.values}) for each in manifest.status]
        number = int(of_set[1]["set"])
        if number <= self.number:  # The group has begun again.
            self.manifests.clear()
        self.number = number
        self.manifests.append((number, {output: told for output, told in inputs if output in self.held}))
        self.join()

    def join(self):
        while self.manifests:
            number, told = self.manifests[0]
            found = {output: self.find(output, int(each.get("sequence", 0))) for output, each in told.items()}
            if any(each is WAITING for each in found.values()):
                return
            self.manifests.popleft()
            if all(each is None or fits(each, told[output]) for output, each in found.items()):
                self.take(number, found)

    def find(self, output, sequence):
        """The message; None of one that is missing, LOST or WAITING of one that did not come, or not yet."""
        held = self.held[output]
        for older in [each for each in held if each < sequence]:
            del held[older]
        return held.get(sequence, LOST if held else WAITING) if sequence else None


LOST, WAITING = object(), object()


def fits(message, told):
    return message is not LOST and stamp_ns(message) in (None, int(told["stamp_ns"]))


def stamp_ns(message):
    """The stamp of a message that begins with a header; None of any other."""
    stamp = message.header.stamp if hasattr(message, "header") else None
    return stamp and stamp.sec * 1_000_000_000 + stamp.nanosec


def main():
    manifest, *words = sys.argv[1:]
    outputs = dict(zip(words[::2], words[1::2], strict=True))

    def show(number, messages):
        stamps = {output: message and stamp_ns(message) for output, message in messages.items()}
        print(json.dumps({"set": number, **stamps}), flush=True)

    rclpy.init()
    node = rclpy.create_node("join_sets")
    joiner = SetJoiner(outputs, show)
    node.create_subscription(DiagnosticArray, manifest, joiner.add_manifest, KEEP)
    for output, type_name in outputs.items():
        package, _, name = type_name.split("/")
        message_type = getattr(importlib.import_module(f"{package}.msg"), name)
        node.create_subscription(message_type, output, partial(joiner.add_message, output), KEEP)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == "__main__":
    main()
