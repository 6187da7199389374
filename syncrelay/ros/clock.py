"""The clocks of a node: one measures how long messages wait, the other triggers sets.

Both are ROS time if that is simulated. Otherwise the first is monotonic, and the second is the system clock, with which
messages are stamped.
"""

import logging
import time
from collections.abc import Callable
from typing import Any

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rosgraph_msgs.msg import Clock

_LOG = logging.getLogger("syncrelay")

# A clock may fall back by this much without a jump: two publishers of /clock, or one that rounds.
_JUMP = Duration(nanoseconds=-1_000_000_000)
_FORWARD = Duration(nanoseconds=1)


class WaitingClock:
    """A node's clock, as its parameter `use_sim_time` has it."""

    def __init__(self, node: Any) -> None:
        self._clock = node.get_clock()
        self._handle: Any = None
        self.is_simulated = bool(node.get_parameter("use_sim_time").value)
        for subscription in node.subscriptions:
            # rclpy's own, which is there from the start where time is simulated.
            if subscription.msg_type is Clock:
                subscription.callback = _since_1970(subscription.callback)
        self.now: Callable[[], int] = self._simulated_now if self.is_simulated else time.monotonic_ns
        """The time in nanoseconds, to measure waiting only."""
        self.stamping: Callable[[], int] = self._simulated_now if self.is_simulated else time.time_ns
        """The time in nanoseconds that messages of now are stamped with."""

    def _simulated_now(self) -> int:
        return int(self._clock.now().nanoseconds)

    def follow(self, *, jumped_back: Callable[[], None], ticked: Callable[[], None]) -> None:
        """Call one of these at each change of simulated time, on the thread that serves the node, until `close`."""
        if not self.is_simulated:
            return

        def changed(jump: Any) -> None:
            (jumped_back if jump.delta <= _JUMP else ticked)()

        threshold = JumpThreshold(min_forward=_FORWARD, min_backward=_JUMP, on_clock_change=True)
        self._handle = self._clock.create_jump_callback(threshold, post_callback=changed)

    def close(self) -> None:
        """Follow the clock no longer."""
        if self._handle is not None:
            self._handle.unregister()


def _since_1970(take: Callable[[Any], None]) -> Callable[[Any], None]:
    """Return a callback for /clock that ignores negative times, for which rclpy raises."""
    was_said = False

    def take_valid(message: Any) -> None:
        nonlocal was_said
        if message.clock.sec >= 0:
            take(message)
        elif not was_said:
            was_said = True
            _LOG.warning(
                "/clock is at %d s, and no time in ROS is below 0: ignored until it is 0 or more",
                message.clock.sec,
            )

    return take_valid
