"""The compiled backend, which takes and publishes messages in librcl, and proves at every start that it can.

No version number is trusted: structures of librcl are compared with what librcl does with them, and two messages of
our own go there and back within this process before any other message does.
"""

import ctypes
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from builtin_interfaces.msg import Time
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from syncrelay.dataflow.backend import BackendName, Deliver, Inbox, RclCallError
from syncrelay.ros.compiled import path
from syncrelay.ros.entities import has_subscriber, never_called

_FUNCTIONS: Final = {
    "librcl.so": (
        "rcl_take_serialized_message",
        "rcl_publish_serialized_message",
        "rcl_subscription_set_on_new_message_callback",
        "rcl_node_get_graph_guard_condition",
        "rcl_wait_set_add_guard_condition",
    ),
    "librcutils.so": (
        "rcutils_uint8_array_init",
        "rcutils_uint8_array_fini",
        "rcutils_get_default_allocator",
        "rcutils_get_error_string",
        "rcutils_reset_error",
    ),
}
_PATIENCE_NS: Final = 10_000_000_000
# A Time of 1 s and 2 ns, little-endian.
_PAYLOAD: Final = bytes([0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0])
# A change of the graph that rcl never reported is found after this long.
_FORCE_S: Final = 60.0


def addresses() -> dict[str, int]:
    """Return where the functions are, in the libraries that rclpy has loaded.

    Raises OSError or AttributeError where one is not there.
    """
    return {
        name: ctypes.cast(getattr(ctypes.CDLL(library), name), ctypes.c_void_p).value or 0
        for library, names in _FUNCTIONS.items()
        for name in names
    }


class CompiledOutlet(path.Outlet):
    """A publisher that librcl sends through."""

    def __init__(self, librcl: path.Librcl, publisher: Any) -> None:
        super().__init__(librcl, publisher)
        self._publisher = publisher

    def is_heard(self) -> bool:
        """Whether anyone subscribes; not where rcl cannot tell, of which `send` says why."""
        return has_subscriber(self._publisher)


class GraphChanges:
    """Reads the guard condition that rcl triggers whenever a node or an endpoint of any process comes or goes."""

    def __init__(self, librcl: path.Librcl, node: Any) -> None:
        self._librcl = librcl
        self._node = node.handle
        self._wait_set = _rclpy.WaitSet(0, 1, 0, 0, 0, 0, node.context.handle)
        self._forced_at = -_FORCE_S

    def seen(self) -> bool:
        """Whether anything may have changed since this was last asked. Raises RclCallError."""
        self._wait_set.clear_entities()
        self._librcl.add_graph_condition(self._node.pointer, self._wait_set.pointer)
        self._wait_set.wait(0)
        has_changed = bool(self._wait_set.is_ready("guard_condition", 0))
        now = time.monotonic()
        if now - self._forced_at < _FORCE_S:
            return has_changed
        self._forced_at = now
        return True


class CompiledBackend:
    """Takes and publishes in librcl, in compiled code."""

    name = BackendName.COMPILED
    flow = path.Flow

    def __init__(self, librcl: path.Librcl) -> None:
        self._librcl = librcl

    def source(self, subscription: Any, deliver: Deliver) -> path.Source:
        """Drain a raw rclpy subscription from now on."""
        return path.Source(self._librcl, subscription, deliver)

    def outlet(self, publisher: Any) -> CompiledOutlet:
        """Publish through an rclpy publisher."""
        return CompiledOutlet(self._librcl, publisher)

    def inbox(self) -> Inbox:
        """Make an inbox, with no sources yet."""
        inbox: Inbox = path.Inbox()
        return inbox

    def graph_changes(self, node: Any) -> GraphChanges:
        """Follow the graph as a node sees it."""
        return GraphChanges(self._librcl, node)


def proven_backend(node: Any) -> CompiledBackend:
    """Return the compiled backend, proven on a topic of the node's own.

    Raises OSError, AttributeError or RclCallError where librcl is not as expected.
    """
    backend = CompiledBackend(path.Librcl(addresses()))
    changes = backend.graph_changes(node)
    changes.seen()
    with _own_topic(node) as (subscription, publisher):
        _require(changes.seen(), "librcl does not report changes in the graph")
        _send_there_and_back(backend, subscription, publisher)
    return backend


def _send_there_and_back(backend: CompiledBackend, subscription: Any, publisher: Any) -> None:
    """Have rclpy publish a message and send the same one on from librcl: both must come in alike."""
    came: list[tuple[bytes, int]] = []

    def deliver(payload: Any) -> None:
        came.append((bytes(payload.content()), payload.received))
        if len(came) == 1:
            backend.outlet(publisher).send(payload)

    inbox, source = backend.inbox(), backend.source(subscription, deliver)
    inbox.add(source)
    before, end = time.time_ns(), time.monotonic_ns() + _PATIENCE_NS
    try:
        publisher.handle.publish_raw(_PAYLOAD)
        while len(came) < 2 and (left := end - time.monotonic_ns()) > 0 and not inbox.failed:  # noqa: PLR2004
            inbox.receive_once(left)
        failed = inbox.failed.get(source)
    finally:
        inbox.close()
    _require(failed is None, str(failed))
    source.require_margin()
    _require([content for content, _ in came] == [_PAYLOAD, _PAYLOAD], "a message does not come back as it was")
    times_are_right = all(0 <= received - before <= _PATIENCE_NS for _, received in came)
    _require(times_are_right, "the time of receipt is not as expected")
    numbers_are_right = all(
        each.sent == each.delivered == len(came) and 0 <= each.published - before <= _PATIENCE_NS
        for each in source.deliveries()
    )
    _require(numbers_are_right, "the number of a message or the time of its publication is not as expected")


def _require(holds: bool, what: str) -> None:  # noqa: FBT001  an assertion
    if not holds:
        raise RclCallError(what)


@contextmanager
def _own_topic(node: Any) -> Iterator[tuple[Any, Any]]:
    """A raw subscription and a publisher, on a topic that nobody else has and `ros2 topic list` hides."""
    # Without the node's namespace: a long one would make the name longer than DDS takes.
    topic = f"/_syncrelay_check_{uuid.uuid4().hex}"
    subscription = node.create_subscription(Time, topic, never_called, 10, raw=True)
    publisher = node.create_publisher(Time, topic, 10)
    try:
        yield subscription, publisher
    finally:
        node.destroy_publisher(publisher)
        node.destroy_subscription(subscription)
