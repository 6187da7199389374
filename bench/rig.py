"""The publisher and the receiver around a relay under test, each a process that rounds.py starts.

    rig.py publish TYPE --size BYTES --rate HZ --together N --apart SECONDS [--own-stamps] TOPIC...
    rig.py receive TYPE --together N [--bundled TYPE] [--hear MANIFEST] TOPIC...

Both say `ready` when DDS has matched them, and then wait for turns on stdin. Stamps are times of publishing by the
system clock, so that the age of a set's last message, when it comes back, is its latency.
"""

import argparse
import json
import statistics
import sys
import time
from importlib import import_module

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Image, Imu

from syncrelay.cdr import patch_stamp, read_stamp

TYPES = {"Image": Image, "Imu": Imu}
PROFILE = QoSProfile(depth=100)
POLL_S = 0.02
# What has not come after so long a silence is lost.
SILENCE_S = 1.0


def publish(node, asked):
    """In each turn publish as many sets of each group as stdin says.

    Topics that go `together` follow each other `apart` seconds; the next ones come later, spread evenly over a period.
    """
    publishers = [node.create_publisher(TYPES[asked.type], topic, PROFILE) for topic in asked.topics]
    while any(publisher.get_subscription_count() < 1 for publisher in publishers):
        time.sleep(POLL_S)
    say("ready")
    groups = [publishers[at : at + asked.together] for at in range(0, len(publishers), asked.together)]
    payload = payload_of(asked.type, asked.size)
    for line in sys.stdin:
        began = time.monotonic()
        for number in range(int(line) * len(groups)):
            due = began + number / (asked.rate * len(groups))
            time.sleep(max(0.0, due - time.monotonic()))
            group = groups[number % len(groups)]
            # One stamp, when the last of them is due: however busy the machine is, they are a set.
            payload = patch_stamp(payload, time.time_ns() + int((len(group) - 1) * asked.apart * 1e9))
            for publisher in group:
                if asked.own_stamps:
                    payload = patch_stamp(payload, time.time_ns())
                publisher.publish(payload)
                if asked.apart:
                    time.sleep(asked.apart)
        say("done")


def payload_of(type_name, size):
    """A serialized message; an image has so many bytes of pixels."""
    message = Imu() if type_name == "Imu" else Image(height=1, width=size, step=size, data=bytes(size))
    return serialize_message(message)


def receive(node, asked):
    """For each line of stdin, take so many messages with stamps from a time on, until all came or none comes any more.

    Prints how many came, and the median age of sets.
    """
    kind, topics = TYPES[asked.type], asked.topics
    # A bundle counts as its messages, and is a set by itself.
    each, together = (asked.together, 1) if asked.bundled else (1, asked.together)
    if asked.bundled:
        kind = TYPES.get(asked.bundled) or import_module("bench_msgs.msg").Set
    subscriptions = [node.create_subscription(kind, topic, print, PROFILE, raw=True) for topic in topics]
    # DDS receives and acknowledges manifests, whether anyone takes them or not.
    heard = [node.create_subscription(DiagnosticArray, topic, print, 500, raw=True) for topic in asked.hear]
    while any(node.count_publishers(each.topic_name) < 1 for each in [*subscriptions, *heard]):
        time.sleep(POLL_S)
    say("ready")
    wait_set = _rclpy.WaitSet(len(topics), 0, 0, 0, 0, 0, rclpy.get_default_context().handle)
    for line in sys.stdin:
        (since, due), ages, came, last = json.loads(line), [], 0, time.monotonic()
        while came < due and time.monotonic() < last + SILENCE_S:
            wait_set.clear_entities()
            for subscription in subscriptions:
                wait_set.add_subscription(subscription.handle)
            wait_set.wait(int(POLL_S * 1e9))
            for index, subscription in enumerate(subscriptions):
                while wait_set.is_ready("subscription", index) and (taken := take(subscription.handle, kind)):
                    stamp, last = read_stamp(taken[0]) or 0, time.monotonic()
                    came += each * (stamp >= since)
                    # The last topic of a set completes it: the others wait for it, whatever the relay.
                    if stamp >= since and (index + 1) % together == 0:
                        ages.append(time.time_ns() - stamp)
        say([came, statistics.median(ages) if ages else 0])


def take(handle, kind):
    return handle.take_message(kind, True)  # noqa: FBT003  rclpy's signature


def say(answer):
    print(answer if isinstance(answer, str) else json.dumps(answer), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("command", choices=("publish", "receive"))
    parser.add_argument("type", choices=TYPES)
    parser.add_argument("topics", nargs="+", metavar="TOPIC")
    parser.add_argument("--size", type=int)
    parser.add_argument("--rate", type=float)
    parser.add_argument("--together", type=int)
    parser.add_argument("--apart", type=float)
    parser.add_argument("--own-stamps", action="store_true")
    parser.add_argument("--bundled")
    parser.add_argument("--hear", action="append", default=[])
    asked = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node(f"bench_{asked.command}")
    {"publish": publish, "receive": receive}[asked.command](node, asked)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
