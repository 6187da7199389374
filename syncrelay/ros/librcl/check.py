"""Whether librcl may be called here: our structures compared with what it does with them.

No version number is trusted. Each structure stands before a margin that must stay as it is, and two messages go
there and back within this process, one taken by librcl and one by rclpy, which must agree.
"""

import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from ctypes import CDLL, Structure, addressof, byref, c_uint8, memset, sizeof
from typing import Any, ClassVar, Final

from builtin_interfaces.msg import Time

from syncrelay.ros.librcl.backend import LibrclBackend
from syncrelay.ros.librcl.buffers import Memory, Payload, Pool
from syncrelay.ros.librcl.rcl import Allocator, MessageInfo, Rcl, RclCallError, SerializedMessage, pointer

_MARGIN: Final = 256
_UNTOUCHED: Final = 0xA5
PATIENCE_NS: Final = 10_000_000_000
_ROOM: Final = 17
# A Time of 1 s and 2 ns, little-endian.
PAYLOAD: Final = bytes([0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0])


class LibrclUnusableError(Exception):
    """Why messages are not taken and published in librcl here."""


class _RoomyAllocator(Structure):
    _fields_: ClassVar = [("allocator", Allocator), ("margin", c_uint8 * _MARGIN)]


class _RoomyMessage(Structure):
    _fields_: ClassVar = [("message", SerializedMessage), ("margin", c_uint8 * _MARGIN)]


class _RoomyInfo(Structure):
    _fields_: ClassVar = [("info", MessageInfo), ("margin", c_uint8 * _MARGIN)]


def checked_backend(node: Any) -> LibrclBackend:
    """Return the librcl backend, proven on topics of the node's own; raises LibrclUnusableError."""
    try:
        rcl = Rcl()
        _check_serialized_message(rcl)
        _check_there_and_back(rcl, node)
    except (OSError, AttributeError, RclCallError) as error:
        raise LibrclUnusableError(str(error)) from error
    return LibrclBackend(rcl)


def _require(holds: bool, what: str) -> None:  # noqa: FBT001  an assertion
    if not holds:
        raise LibrclUnusableError(what)


def _require_margin(roomy: Any, name: str) -> None:
    _require(bytes(roomy.margin) == bytes([_UNTOUCHED] * _MARGIN), f"{name} is larger than expected")


def _check_serialized_message(rcl: Rcl) -> None:
    default_allocator = CDLL("librcutils.so").rcutils_get_default_allocator
    default_allocator.restype = _RoomyAllocator
    allocator = default_allocator()
    roomy = _RoomyMessage()
    memset(addressof(roomy), _UNTOUCHED, sizeof(roomy))
    rcl.require(rcl.array_init(addressof(roomy), _ROOM, byref(allocator)), "rcutils_uint8_array_init")
    _require_margin(roomy, "rmw_serialized_message_t")
    message = roomy.message
    _require((message.length, message.capacity) == (0, _ROOM), "rmw_serialized_message_t has other fields")
    _require(bytes(message.allocator) == bytes(allocator.allocator), "rcutils_allocator_t has other fields")
    rcl.require(rcl.array_fini(addressof(roomy)), "rcutils_uint8_array_fini")
    _require(message.buffer is None, "rmw_serialized_message_t keeps its buffer elsewhere")


def _check_there_and_back(rcl: Rcl, node: Any) -> None:
    backend = LibrclBackend(rcl)
    changes = backend.graph_changes(node)
    changes.seen()
    with endpoints(node) as (subscription, publisher):
        _require(changes.seen(), "librcl does not report changes in the graph")
        source, watch = backend.source(subscription, _never_called), backend.watch()
        try:
            watch.add(source)
            watch.wait(0)
            publisher.handle.publish_raw(PAYLOAD)
            _require(source in watch.wait(PATIENCE_NS)[0], "DDS does not report messages that arrive")
            pool = Pool(rcl)
            memory = pool.make()
            ours = _take_with_margin(rcl, source.address, memory)
            backend.outlet(publisher).send(Payload(memory, pool, 0))
            _require(source in watch.wait(PATIENCE_NS)[0], "DDS does not get what is published in librcl")
            theirs = subscription.handle.take_message(Time, True)  # noqa: FBT003  rclpy's signature
        finally:
            watch.close()
    _require(theirs is not None and theirs[0] == PAYLOAD, "a message published in librcl comes back changed")
    _compare(ours, theirs[1])


def _take_with_margin(rcl: Rcl, subscription: int, memory: Memory) -> MessageInfo:
    roomy = _RoomyInfo()
    memset(addressof(roomy), _UNTOUCHED, sizeof(roomy))
    code = rcl.take(pointer(subscription), memory.pointer, byref(roomy), None)
    rcl.require(code, "rcl_take_serialized_message")
    _require_margin(roomy, "rmw_message_info_t")
    _require(memory.content() == PAYLOAD, "a message taken in librcl differs from the one published")
    info: MessageInfo = roomy.info
    return info


def _compare(ours: MessageInfo, theirs: Mapping[str, int]) -> None:
    """Compare what librcl says of the first message with what rclpy says of the second, sent within a moment."""
    for name in ("source_timestamp", "received_timestamp"):
        _require(0 <= theirs[name] - getattr(ours, name) <= PATIENCE_NS, f"{name} is not what rclpy says")


@contextmanager
def endpoints(node: Any) -> Iterator[tuple[Any, Any]]:
    """A raw subscription and a publisher, on a topic that nobody else has and `ros2 topic list` hides."""
    # Of no namespace: one that is long would make the name longer than DDS takes.
    topic = f"/_syncrelay_check_{uuid.uuid4().hex}"
    subscription = node.create_subscription(Time, topic, _never_called, 10, raw=True)
    publisher = node.create_publisher(Time, topic, 10)
    try:
        yield subscription, publisher
    finally:
        node.destroy_publisher(publisher)
        node.destroy_subscription(subscription)


def _never_called(*_: Any) -> None:
    """Fill the place of a callback."""
