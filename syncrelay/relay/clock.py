"""The clocks of a node: one measures how long messages wait, the other triggers sets.

Both are ROS time if that is simulated. Otherwise the first is monotonic, and the second is the system clock, with which
messages are stamped.
"""

from collections.abc import Callable

from syncrelay.relay.ports import Node
from syncrelay.runtime import Runtime


class WaitingClock:
    """A node's clock, as its parameter `use_sim_time` has it."""

    def __init__(self, node: Node, *, runtime: Runtime) -> None:
        self._node = node
        self._unfollow: Callable[[], None] = lambda: None
        self.is_simulated = node.is_simulated
        self.now: Callable[[], int] = node.ros_time_ns if self.is_simulated else runtime.monotonic_ns
        """The time in nanoseconds, to measure waiting only."""
        self.stamping: Callable[[], int] = node.ros_time_ns if self.is_simulated else runtime.time_ns
        """The time in nanoseconds that messages of now are stamped with."""

    def follow(self, *, jumped_back: Callable[[], None], ticked: Callable[[], None]) -> None:
        """Call one of these at each change of simulated time, on the thread that serves the node, until `close`."""
        if self.is_simulated:
            self._unfollow = self._node.follow_clock(lambda by: (jumped_back if by < 0 else ticked)())

    def close(self) -> None:
        """Follow the clock no longer."""
        self._unfollow()
