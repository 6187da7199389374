"""From a received message to a published set, whichever way messages pass through rcl; needs no ROS."""
