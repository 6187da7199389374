"""The network interfaces of this process's network namespace, as far as discovery needs them."""

import fcntl
import socket
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from syncrelay.doctor.diagnosis import Diagnosis, error, info

# <linux/sockios.h> and <linux/if.h>. Asked of the kernel: /sys may be mounted for another network namespace.
_SIOCGIFFLAGS: Final = 0x8913
_REQUEST: Final = struct.Struct("16sH22x")
_UP, _LOOPBACK, _MULTICAST = 0x1, 0x8, 0x1000


@dataclass(frozen=True, slots=True)
class Interface:
    """A network interface; `hardware` says whether a device of the machine is behind it."""

    name: str
    is_up: bool
    is_loopback: bool
    multicast: bool
    hardware: bool = False


def check_network(interfaces: Sequence[Interface], *, discovery_range: str, middleware: str) -> Iterator[Diagnosis]:
    """Yield what keeps nodes from finding each other; `discovery_range` is one of discovery.RANGES."""
    loopback = [each for each in interfaces if each.is_loopback]
    others = [each for each in interfaces if each.is_up and not each.is_loopback]
    if not any(each.is_up for each in loopback):
        yield error(
            "loopback_down",
            "the loopback interface (lo) is down",
            impact="nodes on this machine do not find each other",
            fix="ip link set lo up    (as root)",
        )
    elif not others:
        yield from _alone(loopback, discovery_range, middleware)
    if others and discovery_range == "SUBNET" and not any(each.multicast for each in others):
        yield info(
            "no_multicast",
            f"no interface but lo can do multicast ({', '.join(each.name for each in others)}), as with many VPNs",
            impact="nodes on other machines are not found automatically",
            fix="list them on every machine: export ROS_STATIC_PEERS='ADDRESS;ADDRESS'",
        )


def _alone(loopback: Sequence[Interface], discovery_range: str, middleware: str) -> Iterator[Diagnosis]:
    # Fast DDS finds its own over a loopback without multicast (measured); Cyclone DDS does not.
    if "cyclonedds" in middleware and not any(each.multicast for each in loopback):
        yield error(
            "loopback_multicast",
            "lo is the only network interface, and it has no multicast",
            impact="Cyclone DDS finds no node over it",
            fix="ip link set lo multicast on    (as root), or use rmw_fastrtps_cpp",
        )
    elif discovery_range != "LOCALHOST":
        yield info(
            "no_network",
            "there is no network interface but lo",
            impact="only nodes on this machine, or in this container, are found",
            fix="nothing if all nodes are here; otherwise bring the network up (Docker: --network host)",
        )


def look_at_interfaces() -> tuple[Interface, ...]:
    """Return all interfaces, by their names."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        return tuple(_interface(asked, name) for _, name in sorted(socket.if_nameindex(), key=lambda each: each[1]))


def _interface(asked: socket.socket, name: str) -> Interface:
    answer = fcntl.ioctl(asked, _SIOCGIFFLAGS, _REQUEST.pack(name.encode(), 0))
    _, flags = _REQUEST.unpack(answer)
    return Interface(
        name=name,
        is_up=bool(flags & _UP),
        is_loopback=bool(flags & _LOOPBACK),
        multicast=bool(flags & _MULTICAST),
        hardware=Path("/sys/class/net", name, "device").exists(),
    )
