"""The compiled backend: librcl's path in machine code, from the wake to the outlets."""

import ctypes
from typing import Any, Final

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from syncrelay.dataflow.backend import BackendName, Deliver, Inbox
from syncrelay.ros.compiled import path
from syncrelay.ros.librcl.buffers import OwnMessage
from syncrelay.ros.librcl.graph_changes import GraphChanges
from syncrelay.ros.librcl.rcl import Allocator, MessageInfo, Rcl, SerializedMessage, pointer

_SIZES: Final = tuple(map(ctypes.sizeof, (Allocator, SerializedMessage, MessageInfo)))


class CompiledOutlet(path.Outlet):
    """A publisher that librcl sends through."""

    def __init__(self, rcl: Rcl, functions: path.Functions, publisher: Any) -> None:
        super().__init__(functions, publisher)
        self._rcl = rcl
        self._own = OwnMessage(rcl)
        self._pointer = pointer(publisher.handle.pointer)
        self._count_subscriptions = publisher.handle.get_subscription_count

    def send_content(self, content: bytes) -> None:
        """Publish a message that was serialized here. Raises PublishError."""
        self._own.fill(content)
        code = self._rcl.publish(self._pointer, self._own.pointer, None)
        if code:
            self._fail(code)
        self.sent += 1

    def is_heard(self) -> bool:
        """Whether anyone subscribes; not where rcl cannot tell, of which `send` says why."""
        try:
            return bool(self._count_subscriptions())
        except _rclpy.RCLError:
            return False


class CompiledBackend:
    """Takes and publishes in librcl, in compiled code."""

    name = BackendName.COMPILED
    flow = path.Flow

    def __init__(self, rcl: Rcl) -> None:
        """Raise ValueError where the structures are not those of the module."""
        if _SIZES != path.SIZES:
            raise ValueError(f"built for structures of {path.SIZES} bytes, here they have {_SIZES}")
        self._rcl = rcl
        self._functions = path.Functions(
            take=_address(rcl.take),
            publish=_address(rcl.publish),
            array_init=_address(rcl.array_init),
            array_fini=_address(rcl.array_fini),
            set_on_new_message=_address(rcl.set_on_new_message),
            allocator=bytes(rcl.default_allocator()),
            require=rcl.require,
        )

    def source(self, subscription: Any, deliver: Deliver) -> path.Source:
        """Drain a raw rclpy subscription from now on."""
        return path.Source(self._functions, subscription, deliver)

    def outlet(self, publisher: Any) -> CompiledOutlet:
        """Publish through an rclpy publisher."""
        return CompiledOutlet(self._rcl, self._functions, publisher)

    def inbox(self, *, coalesce_ns: int = 0) -> Inbox:
        """Make an inbox, with no sources yet."""
        inbox: Inbox = path.Inbox(coalesce_ns=coalesce_ns)
        return inbox

    def graph_changes(self, node: Any) -> GraphChanges:
        """Follow the graph as a node sees it."""
        return GraphChanges(self._rcl, node)


def _address(function: Any) -> int:
    address = ctypes.cast(function, ctypes.c_void_p).value
    if address is None:
        raise ValueError(f"{function} has no address")
    return address
