"""Whether the ROS graph has changed: rcl knows, so the publishers of every topic need not be asked for again."""

import time
from typing import Any, Final

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from syncrelay.ros.librcl.rcl import Rcl

# A change that was never reported must not hide a publisher for ever.
_FORCE_S: Final = 60.0


class GraphChanges:
    """Reads the guard condition that rcl triggers whenever a node or an endpoint of any process comes or goes."""

    def __init__(self, rcl: Rcl, node: Any) -> None:
        self._rcl = rcl
        # It owns what the address points to.
        self._node = node.handle
        self._condition: Final[int] = rcl.graph_guard_condition(node.handle.pointer)
        self._wait_set = _rclpy.WaitSet(0, 1, 0, 0, 0, 0, node.context.handle)
        self._forced_at = -_FORCE_S

    def seen(self) -> bool:
        """Whether anything may have changed since this was last asked. Raises RclCallError."""
        self._wait_set.clear_entities()
        code = self._rcl.add_guard_condition(self._wait_set.pointer, self._condition, None)
        self._rcl.require(code, "rcl_wait_set_add_guard_condition")
        self._wait_set.wait(0)
        has_changed = bool(self._wait_set.is_ready("guard_condition", 0))
        now = time.monotonic()
        if now - self._forced_at < _FORCE_S:
            return has_changed
        self._forced_at = now
        return True
