"""What can go wrong before a message flows: facts of this machine in, diagnoses in words out.

The checks are pure functions over values; `machine` gathers those values, and `syncrelay.ros` what needs rclpy.
"""
