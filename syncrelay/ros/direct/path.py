"""The direct path as the receive loop uses it."""

from typing import Any

from syncrelay.ros.direct.buffers import Pool
from syncrelay.ros.direct.events import EventWatch
from syncrelay.ros.direct.graph_changes import GraphChanges
from syncrelay.ros.direct.messages import DirectOutlet, DirectSource
from syncrelay.ros.direct.rcl import Rcl
from syncrelay.ros.path import Deliver, PathName


class DirectPath:
    """Takes and publishes in librcl: payloads are memory of ours that Python never copies."""

    name = PathName.DIRECT

    def __init__(self, rcl: Rcl) -> None:
        self._rcl = rcl

    def source(self, subscription: Any, deliver: Deliver) -> DirectSource:
        """Drain a raw rclpy subscription from now on."""
        return DirectSource(self._rcl, Pool(self._rcl), subscription, deliver)

    def outlet(self, publisher: Any) -> DirectOutlet:
        """Publish through an rclpy publisher."""
        return DirectOutlet(self._rcl, publisher)

    def watch(self) -> EventWatch:
        """Make a watch, with no sources yet."""
        return EventWatch(self._rcl)

    def graph_changes(self, node: Any) -> GraphChanges:
        """Follow the graph as a node sees it."""
        return GraphChanges(self._rcl, node)
