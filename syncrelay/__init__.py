"""A ROS 2 relay that matches messages by time, told how by a YAML file."""
