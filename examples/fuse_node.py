"""A node of your own with the engine inside: pairs the IMU with the magnetometer, and publishes a heading.

python3 fuse_node.py     (needs ROS 2, and syncrelay)
"""

import math
from contextlib import suppress

import rclpy
from geometry_msgs.msg import Vector3Stamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import Imu, MagneticField

from syncrelay.sync import ApproximateTime, Match, Message, SyncGroup


class Heading(Node):
    def __init__(self):
        super().__init__("heading")
        self.group = SyncGroup(ApproximateTime(n_inputs=2, queue_size=20, slop_ns=20_000_000), max_wait_ns=100_000_000)
        self.heading = self.create_publisher(Vector3Stamped, "heading", 10)
        for at, (topic, kind) in enumerate({"imu": Imu, "mag": MagneticField}.items()):
            self.create_subscription(kind, topic, lambda message, at=at: self.take(at, message), 10)
        self.create_timer(0.01, lambda: self.see(self.group.expire(now=self.now())))

    def now(self):
        return self.get_clock().now().nanoseconds

    def take(self, at, message):
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        self.see(self.group.add(Message(at, stamp, message), now=self.now()))

    def see(self, outcomes):
        for outcome in outcomes:
            if not isinstance(outcome, Match):
                self.get_logger().debug(f"input {outcome.message.input}: {outcome.reason.meaning}")
                continue
            imu, mag = (message.payload for message in outcome.messages if message)
            yaw = math.atan2(-mag.magnetic_field.y, mag.magnetic_field.x)
            told = Vector3Stamped(header=imu.header)
            told.vector.x, told.vector.y = yaw, imu.angular_velocity.z
            self.heading.publish(told)


if __name__ == "__main__":
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Heading())
