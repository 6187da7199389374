"""The network interfaces of this process's network namespace."""

import fcntl
import socket
import struct
from pathlib import Path
from typing import Final

from syncrelay.doctor.network import Interface

# <linux/sockios.h> and <linux/if.h>. Asked of the kernel: /sys may be mounted for another network namespace.
_SIOCGIFFLAGS: Final = 0x8913
_REQUEST: Final = struct.Struct("16sH22x")
_UP, _LOOPBACK, _MULTICAST = 0x1, 0x8, 0x1000


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
