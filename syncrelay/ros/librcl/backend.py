"""The librcl backend as the receive loop uses it."""

from typing import Any

from syncrelay.dataflow.backend import BackendName, Deliver, Inbox
from syncrelay.dataflow.flow import Flow
from syncrelay.dataflow.inbox import PolledInbox
from syncrelay.ros.librcl.buffers import Pool
from syncrelay.ros.librcl.events import EventWatch
from syncrelay.ros.librcl.graph_changes import GraphChanges
from syncrelay.ros.librcl.messages import LibrclOutlet, LibrclSource
from syncrelay.ros.librcl.rcl import Rcl


class LibrclBackend:
    """Takes and publishes in librcl: payloads are memory of ours that Python never copies."""

    name = BackendName.LIBRCL
    flow = Flow

    def __init__(self, rcl: Rcl) -> None:
        self.rcl = rcl

    def source(self, subscription: Any, deliver: Deliver) -> LibrclSource:
        """Drain a raw rclpy subscription from now on."""
        return LibrclSource(self.rcl, Pool(self.rcl), subscription, deliver)

    def outlet(self, publisher: Any) -> LibrclOutlet:
        """Publish through an rclpy publisher."""
        return LibrclOutlet(self.rcl, publisher)

    def watch(self) -> EventWatch:
        """Make a watch, with no sources yet."""
        return EventWatch(self.rcl)

    def inbox(self, *, coalesce_ns: int = 0) -> Inbox:
        """Make an inbox, with no sources yet."""
        return PolledInbox(self.watch(), coalesce_ns=coalesce_ns)

    def graph_changes(self, node: Any) -> GraphChanges:
        """Follow the graph as a node sees it."""
        return GraphChanges(self.rcl, node)
