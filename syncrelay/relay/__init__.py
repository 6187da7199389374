"""What the relay does, over the ports of `ports.py`; nothing here knows rclpy."""
