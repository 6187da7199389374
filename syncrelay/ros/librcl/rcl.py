"""What is called in librcl, through ctypes.

Structures after rcutils/types/uint8_array.h, rcutils/allocator.h and rmw/types.h of Jazzy. check.py holds them to
what the libraries do before any of them carries a message.
"""

from ctypes import CDLL, Structure, byref, c_bool, c_char, c_int, c_int64, c_size_t, c_uint8, c_uint64, c_void_p
from typing import Any, ClassVar, Final

OK: Final = 0
NOTHING_TAKEN: Final = 401  # RCL_RET_SUBSCRIPTION_TAKE_FAILED


class RclCallError(Exception):
    """A call that librcl refused, in its words."""


class Allocator(Structure):
    """rcutils_allocator_t."""

    _fields_: ClassVar = [
        ("allocate", c_void_p),
        ("deallocate", c_void_p),
        ("reallocate", c_void_p),
        ("zero_allocate", c_void_p),
        ("state", c_void_p),
    ]


class SerializedMessage(Structure):
    """rmw_serialized_message_t, which is rcutils_uint8_array_t."""

    _fields_: ClassVar = [
        ("buffer", c_void_p),
        ("length", c_size_t),
        ("capacity", c_size_t),
        ("allocator", Allocator),
    ]


class Gid(Structure):
    """rmw_gid_t."""

    _fields_: ClassVar = [("implementation_identifier", c_void_p), ("data", c_uint8 * 16)]


class MessageInfo(Structure):
    """rmw_message_info_t; times in nanoseconds of the system clock."""

    _fields_: ClassVar = [
        ("source_timestamp", c_int64),
        ("received_timestamp", c_int64),
        ("publication_sequence_number", c_uint64),
        ("reception_sequence_number", c_uint64),
        ("publisher_gid", Gid),
        ("from_intra_process", c_bool),
    ]


class _ErrorText(Structure):
    """rcutils_error_string_t."""

    _fields_: ClassVar = [("text", c_char * 1024)]


def pointer(address: int) -> Any:
    """An address as an argument that ctypes passes on as it is."""
    return byref(c_uint8.from_address(address))


class Rcl:
    """The functions, with pointers as plain addresses; `take` and `publish` want a `pointer` for each.

    The libraries are those that rclpy has loaded: asked for by the same names, the loader gives the same ones.
    Raises OSError or AttributeError where they are not as expected.
    """

    def __init__(self) -> None:
        rcl, rcutils, libc = CDLL("librcl.so"), CDLL("librcutils.so"), CDLL(None)
        # Called for each message, with arguments made before: to convert numbers costs as much again as to call.
        self.take = rcl.rcl_take_serialized_message
        self.publish = rcl.rcl_publish_serialized_message
        self.set_on_new_message = rcl.rcl_subscription_set_on_new_message_callback
        self.set_on_new_message.argtypes = [c_void_p, c_void_p, c_void_p]
        self.array_init = rcutils.rcutils_uint8_array_init
        self.array_init.argtypes = [c_void_p, c_size_t, c_void_p]
        self.array_fini = rcutils.rcutils_uint8_array_fini
        self.array_fini.argtypes = [c_void_p]
        self.default_allocator = rcutils.rcutils_get_default_allocator
        self.default_allocator.restype = Allocator
        self.graph_guard_condition = rcl.rcl_node_get_graph_guard_condition
        self.graph_guard_condition.argtypes = [c_void_p]
        self.graph_guard_condition.restype = c_void_p
        self.add_guard_condition = rcl.rcl_wait_set_add_guard_condition
        self.add_guard_condition.argtypes = [c_void_p, c_void_p, c_void_p]
        # Called by DDS's threads in the place of a callback, whose arguments are alike: it needs no Python there.
        self.eventfd_write = libc.eventfd_write
        self.eventfd_write.restype = c_int
        self._error_text = rcutils.rcutils_get_error_string
        self._error_text.restype = _ErrorText
        self._reset_error = rcutils.rcutils_reset_error

    def require(self, code: int, what: str) -> None:
        """Raise RclCallError unless a call returned that all is well."""
        if code != OK:
            text = self._error_text().text.decode(errors="replace")
            self._reset_error()
            raise RclCallError(f"{what} failed with {code}: {text}")
