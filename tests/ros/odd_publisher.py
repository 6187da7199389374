"""Publishes over DDS under names and a type that ROS refuses, as whoever uses no ROS may.

rclpy and rcl take no such names, rmw does where it is told to avoid the conventions of ROS: through ctypes. Words are
the type's namespace and name as DDS has them, then the topics, in hexadecimal digits.
"""

import sys
from ctypes import (
    CDLL,
    POINTER,
    Structure,
    byref,
    c_bool,
    c_char_p,
    c_int,
    c_size_t,
    c_uint64,
    c_void_p,
    py_object,
    pythonapi,
)
from typing import Any, ClassVar

import rclpy
from geometry_msgs.msg import Vector3Stamped


class _Time(Structure):
    """rmw_time_t."""

    _fields_: ClassVar = [("sec", c_uint64), ("nsec", c_uint64)]


class _Profile(Structure):
    """rmw_qos_profile_t."""

    _fields_: ClassVar = [
        ("history", c_int),
        ("depth", c_size_t),
        ("reliability", c_int),
        ("durability", c_int),
        ("deadline", _Time),
        ("lifespan", _Time),
        ("liveliness", c_int),
        ("liveliness_lease_duration", _Time),
        ("avoid_ros_namespace_conventions", c_bool),
    ]


class _Options(Structure):
    """rmw_publisher_options_t."""

    _fields_: ClassVar = [("payload", c_void_p), ("require_unique_network_flow_endpoints", c_int)]


# keep_last, reliable, volatile, automatic.
_PROFILE = _Profile(history=1, depth=1, reliability=1, durability=2, liveliness=1, avoid_ros_namespace_conventions=True)


class _Support(Structure):
    """The begin of rosidl_message_type_support_t."""

    _fields_: ClassVar = [("identifier", c_char_p), ("data", c_void_p)]


class _Callbacks(Structure):
    """The begin of message_type_support_callbacks_t (rosidl_typesupport_fastrtps_cpp)."""

    _fields_: ClassVar = [("namespace", c_char_p), ("name", c_char_p)]


def _rename(support: c_void_p, namespace: bytes, name: bytes) -> None:
    """Have a type go by another name, in this process and wherever it publishes."""
    find = CDLL("librosidl_runtime_c.so").get_message_typesupport_handle
    find.restype, find.argtypes = POINTER(_Support), [c_void_p, c_char_p]
    found = find(support, b"rosidl_typesupport_fastrtps_c")
    callbacks = _Callbacks.from_address(found.contents.data)
    callbacks.namespace, callbacks.name = namespace, name


def _type_support(message_type: Any) -> c_void_p:
    message_type.__class__.__import_type_support__()
    capsule = py_object(message_type.__class__._TYPE_SUPPORT)  # noqa: SLF001
    name, pointer = pythonapi.PyCapsule_GetName, pythonapi.PyCapsule_GetPointer
    name.restype, pointer.restype = c_char_p, c_void_p
    pointer.argtypes = [py_object, c_char_p]
    return c_void_p(pointer(capsule, name(capsule)))


def main(namespace: bytes, name: bytes, *topics: bytes) -> None:
    rclpy.init()
    node = rclpy.create_node("odd_publisher")
    rcl, rmw = CDLL("librcl.so"), CDLL("librmw_fastrtps_cpp.so")
    rcl.rcl_node_get_rmw_handle.restype = rmw.rmw_create_publisher.restype = c_void_p
    rmw.rmw_create_publisher.argtypes = [c_void_p, c_void_p, c_char_p, POINTER(_Profile), POINTER(_Options)]
    handle = rcl.rcl_node_get_rmw_handle(c_void_p(node.handle.pointer))
    support = _type_support(Vector3Stamped)
    _rename(support, namespace, name)
    for topic in topics:
        assert rmw.rmw_create_publisher(handle, support, b"rt/" + topic, byref(_PROFILE), byref(_Options()))
    print("up", flush=True)  # noqa: T201  whoever started it waits for this
    sys.stdin.read()


if __name__ == "__main__":
    main(*map(bytes.fromhex, sys.argv[1:]))
