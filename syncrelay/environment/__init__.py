"""What ROS and Fast DDS read from the environment, without importing either."""
