"""A relay as the guides teach it, for comparison: in rclpy, with typed messages and a Python synchronizer.

typed_relay.py TYPE INPUT OUTPUT [TYPE INPUT OUTPUT ...]
"""

import sys

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Image, Imu
from slop_baseline import SlopSynchronizer, Stamp

from syncrelay.sync import Message

TYPES = {"Image": Image, "Imu": Imu}
PROFILE = QoSProfile(depth=100)
SLOP = 5_000_000


def main():
    words = sys.argv[1:]
    routes = list(zip(words[::3], words[1::3], words[2::3], strict=True))
    rclpy.init()
    node = rclpy.create_node("typed_relay")
    publishers = [node.create_publisher(TYPES[name], output, PROFILE) for name, _, output in routes]
    synchronizer = SlopSynchronizer(len(routes), 10, SLOP, Stamp)

    def received(index, message):
        stamp = message.header.stamp
        matched = synchronizer.add(Message(index, stamp.sec * 1_000_000_000 + stamp.nanosec, message))
        for publisher, each in zip(publishers, matched or (), strict=False):
            publisher.publish(each.payload)

    for index, (name, topic, _) in enumerate(routes):
        node.create_subscription(TYPES[name], topic, lambda m, index=index: received(index, m), PROFILE)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        return


if __name__ == "__main__":
    main()
