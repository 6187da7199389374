"""Which graph a node joins, as rcl reads it from the environment: its domain, and how far discovery reaches."""

import ctypes
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from syncrelay.errors import RosUnavailableError
from syncrelay.printable import printable

DISCOVERY_RANGES: Final = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
DOMAIN_ADVICE: Final = "export ROS_DOMAIN_ID=0    or the number that the other nodes have; 0 to 101 are safe on Linux"
_LARGEST_DOMAIN: Final = 232
# DDS: 250 UDP ports for each domain, from 7400 on.
_FIRST_PORT: Final = 7400
_PORTS: Final = 250
_FIRST_PAIR: Final = 10
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


def domains_in_use() -> frozenset[int]:
    """Return the domains of nodes in this network namespace, by the UDP ports that they hold."""
    tables = [path for path in (Path("/proc/net/udp"), Path("/proc/net/udp6")) if path.exists()]
    rows = [row.split() for table in tables for row in table.read_text().splitlines()[1:]]
    held = {int(row[1].rpartition(":")[2], 16) for row in rows}
    # DDS: each participant has two in a row, the first of them even.
    pairs = (
        port for port in held if port % 2 == 0 and port + 1 in held and (port - _FIRST_PORT) % _PORTS >= _FIRST_PAIR
    )
    domains = ((port - _FIRST_PORT) // _PORTS for port in pairs)
    return frozenset(domain for domain in domains if 0 <= domain <= _LARGEST_DOMAIN)


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
