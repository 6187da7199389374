"""The librcl backend as the receive loop uses it."""

from typing import Any

from syncrelay.dataflow.backend import BackendName, Deliver
from syncrelay.ros.librcl.buffers import Pool
from syncrelay.ros.librcl.events import EventWatch
from syncrelay.ros.librcl.graph_changes import GraphChanges
from syncrelay.ros.librcl.messages import LibrclOutlet, LibrclSource
from syncrelay.ros.librcl.rcl import Rcl


class LibrclBackend:
    """Takes and publishes in librcl: payloads are memory of ours that Python never copies."""

    name = BackendName.LIBRCL

    def __init__(self, rcl: Rcl) -> None:
        self._rcl = rcl

    def source(self, subscription: Any, deliver: Deliver) -> LibrclSource:
        """Drain a raw rclpy subscription from now on."""
        return LibrclSource(self._rcl, Pool(self._rcl), subscription, deliver)

    def outlet(self, publisher: Any) -> LibrclOutlet:
        """Publish through an rclpy publisher."""
        return LibrclOutlet(self._rcl, publisher)

    def watch(self) -> EventWatch:
        """Make a watch, with no sources yet."""
        return EventWatch(self._rcl)

    def graph_changes(self, node: Any) -> GraphChanges:
        """Follow the graph as a node sees it."""
        return GraphChanges(self._rcl, node)
