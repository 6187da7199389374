"""What stamps and times of receipt tell of the clock that made the stamps. Sans-IO, without ROS and without groups."""

from syncrelay.clock.device_clock import DeviceClock, Step
from syncrelay.clock.envelope import MOST_RATE
from syncrelay.clock.mapping import UNREADABLE, host_times

__all__ = ["MOST_RATE", "UNREADABLE", "DeviceClock", "Step", "host_times"]
