"""What stands around a relay under test: a process that publishes, and one that receives. Started by relay_runs.py.

    rig.py publish TYPE --size BYTES --rate HZ --warm-up N --counted N --together N TOPIC...
    rig.py receive TYPE --together N TOPIC...

Stamps are times of publishing by the system clock, so that the age of a set's last message, when it comes back, is its
latency. Both say `ready` when DDS has matched them.
"""

import argparse
import json
import select
import statistics
import sys
import time

import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Image, Imu

from syncrelay.cdr import read_stamp, write_stamp

TYPES = {"Image": Image, "Imu": Imu}
PROFILE = QoSProfile(depth=100)
POLL_S = 0.02
# Between two topics of a set, as sensors do not speak in one breath: each message wakes the relay.
APART_S = 0.0002


def publish(node, asked):
    """Publish on all topics; say `warm` before the messages that count, and the span of their stamps after them.

    Topics that go `together` follow each other closely; the next ones come later, spread evenly over the period.
    """
    publishers = [node.create_publisher(TYPES[asked.type], topic, PROFILE) for topic in asked.topics]
    while any(publisher.get_subscription_count() < 1 for publisher in publishers):
        time.sleep(POLL_S)
    say("ready")
    sys.stdin.readline()
    groups = [publishers[at : at + asked.together] for at in range(0, len(publishers), asked.together)]
    payload = payload_of(asked.type, asked.size)
    began = time.monotonic()
    first = last = 0
    for number in range(asked.warm_up + asked.counted):
        if number == asked.warm_up:
            first = time.time_ns()
            say("warm")
        for place, group in enumerate(groups):
            due = began + (number + place / len(groups)) / asked.rate
            time.sleep(max(0.0, due - time.monotonic()))
            # One stamp, when the last of them is due: however busy the machine is, they are a set.
            last = time.time_ns() + int((len(group) - 1) * APART_S * 1e9)
            write_stamp(payload, last)
            for publisher in group:
                publisher.publish(bytes(payload))
                time.sleep(APART_S)
    say([first, last])
    sys.stdin.readline()


def payload_of(type_name, size):
    """A serialized message; an image has so many bytes of pixels."""
    message = Imu() if type_name == "Imu" else Image(height=1, width=size, step=size, data=bytes(size))
    return bytearray(serialize_message(message))


def receive(node, asked):
    """Take what comes until stdin gives a span of stamps; say how much came of it, and the median age of sets."""
    kind, topics = TYPES[asked.type], asked.topics
    subscriptions = [node.create_subscription(kind, topic, print, PROFILE, raw=True) for topic in topics]
    while any(node.count_publishers(topic) < 1 for topic in topics):
        time.sleep(POLL_S)
    say("ready")
    ages = []
    wait_set = _rclpy.WaitSet(len(topics), 0, 0, 0, 0, 0, rclpy.get_default_context().handle)
    while not select.select([sys.stdin], [], [], 0)[0]:
        wait_set.clear_entities()
        for subscription in subscriptions:
            wait_set.add_subscription(subscription.handle)
        wait_set.wait(int(POLL_S * 1e9))
        for index, subscription in enumerate(subscriptions):
            while wait_set.is_ready("subscription", index) and (taken := take(subscription.handle, kind)):
                stamp = read_stamp(taken[0])
                ages.append((stamp, index, time.time_ns() - stamp))
    first, last = json.loads(sys.stdin.readline())
    counted = [(index, age) for stamp, index, age in ages if first <= stamp <= last]
    # The last topic of a set completes it: the others wait for it, whatever the relay.
    completing = [age for index, age in counted if (index + 1) % asked.together == 0]
    say([len(counted), statistics.median(completing) if completing else 0])


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
    parser.add_argument("--warm-up", type=int)
    parser.add_argument("--counted", type=int)
    parser.add_argument("--together", type=int)
    asked = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node(f"bench_{asked.command}")
    {"publish": publish, "receive": receive}[asked.command](node, asked)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
