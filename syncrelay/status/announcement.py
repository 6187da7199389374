"""Which addresses the relays of this machine answer at, whatever their ports, users and containers.

Each holds a name in the kernel's abstract namespace of sockets for as long as it answers. The name goes with the
process, however that ends; every user can read all names; and a network namespace has its own, as it has its own
addresses, so that whoever reads a name can reach what it names.
"""

import re
import socket
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import Final

_PREFIX: Final = "syncrelay-status/"
_TABLE: Final = Path("/proc/net/unix")
_ROW = re.compile(rf" @{_PREFIX}(?P<host>\[[0-9a-f:.]+\]|[0-9.]+):(?P<port>[0-9]{{1,5}})$".encode(), re.MULTILINE)
# Anyone may hold names; a machine has not so many relays.
_MOST: Final = 200
_PORTS: Final = range(1, 65_536)
_LOOPBACK_OF: Final = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104  what a file may say


@dataclass(frozen=True, slots=True, order=True)
class Place:
    """An address that a server is bound to, in which 0.0.0.0 and :: are all of the machine."""

    port: int
    host: str

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @property
    def url(self) -> str:
        """The base URL by which this machine reaches it."""
        return f"http://{Place(self.port, _LOOPBACK_OF.get(self.host, self.host))}"

    @property
    def is_everywhere(self) -> bool:
        """Whether the server answers at every address of the machine."""
        return self.host in _LOOPBACK_OF


def announce(place: Place) -> AbstractContextManager[object]:
    """Return what announces a server until it is left. Where sockets cannot have names it announces nothing."""
    try:
        holder = socket.socket(socket.AF_UNIX)
    except OSError:
        return nullcontext()
    with suppress(OSError):
        holder.bind(f"\0{_PREFIX}{place}")
    return holder


def announced() -> tuple[Place, ...]:
    """Return where servers of this machine say that they answer, by port; what is there is not known before asked."""
    try:
        return places_in(_TABLE.read_bytes())
    except OSError:
        return ()


def places_in(table: bytes) -> tuple[Place, ...]:
    """Return the places that the kernel's table of names holds, by port. Anyone may hold a name that is none."""
    found = {_place(row["host"].decode(), int(row["port"])) for row in _ROW.finditer(table)}
    return tuple(sorted(place for place in found if place is not None)[:_MOST])


def _place(host: str, port: int) -> Place | None:
    try:
        address = str(ip_address(host.strip("[]")))
    except ValueError:
        return None
    return Place(port, address) if port in _PORTS else None
