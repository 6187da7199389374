"""Which graph a node joins, as rcl reads it from the environment: its domain, and how far discovery reaches."""

import ctypes
import os
from collections.abc import Mapping
from typing import Final

from syncrelay.errors import RosUnavailableError
from syncrelay.printable import printable

DISCOVERY_RANGES: Final = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
DOMAIN_ADVICE: Final = "export ROS_DOMAIN_ID=0    or the number that the other nodes have; 0 to 101 are safe on Linux"
_LARGEST_DOMAIN: Final = 232
# DDS: 250 UDP ports for each domain, from 7400 on.
_FIRST_PORT: Final = 7400
_PORTS: Final = 250
# rcl reads the number with it, so that here is read what rcl will read: of 010 eight, of 0x1f 31, of "7x" seven.
_strtoul: Final = ctypes.CDLL(None).strtoul
_strtoul.argtypes = (ctypes.c_char_p, ctypes.POINTER(ctypes.c_char_p), ctypes.c_int)
_strtoul.restype = ctypes.c_ulong


def domain_of(environ: Mapping[str, str]) -> int | None:
    """Return the domain that rcl takes from ROS_DOMAIN_ID; None where it names none that nodes can be on."""
    text = environ.get("ROS_DOMAIN_ID", "")
    if not text:
        return 0
    rest = ctypes.c_char_p()
    number = int(_strtoul(os.fsencode(text), ctypes.byref(rest), 0))
    # What does not begin with a number is 0 with all of it left over; -1 is the largest number of all.
    return None if number > _LARGEST_DOMAIN or (number == 0 and rest.value) else number


def ports_of(domain: int) -> range:
    """Return the UDP ports of a domain; Fast DDS numbers its ports in shared memory alike."""
    return range(_FIRST_PORT + _PORTS * domain, _FIRST_PORT + _PORTS * (domain + 1))


def range_of(environ: Mapping[str, str]) -> str:
    """Return how far discovery reaches: one of DISCOVERY_RANGES."""
    if environ.get("ROS_LOCALHOST_ONLY") == "1":
        return "LOCALHOST"
    asked = environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE") or "SUBNET"
    return asked if asked in DISCOVERY_RANGES else "LOCALHOST"


def no_domain(environ: Mapping[str, str]) -> str:
    """Say what is wrong with a ROS_DOMAIN_ID for which `domain_of` returns None."""
    return (
        f"ROS_DOMAIN_ID={printable(environ['ROS_DOMAIN_ID'])} is not a domain: expected a number from 0 to"
        f" {_LARGEST_DOMAIN}"
    )


def require_domain(environ: Mapping[str, str]) -> None:
    """Raise RosUnavailableError where ROS_DOMAIN_ID names no domain.

    To be asked before rclpy starts: of 300 Fast DDS ends the whole process, and rcl takes -1 for the default.
    """
    if domain_of(environ) is None:
        raise RosUnavailableError(f"{no_domain(environ)}\n  {DOMAIN_ADVICE}")
