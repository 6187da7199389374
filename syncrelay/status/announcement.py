"""Announces the address of a relay to this machine, and finds those of all its relays.

A relay binds a name in the kernel's abstract namespace of sockets while it answers. The name disappears with the
process, however it ends, and every user can read all names. Each network namespace has names of its own, so a reader
can reach every address that it finds.
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
# Any process can bind such names, so the number that is read is bounded.
_MOST: Final = 200
_PORTS: Final = range(1, 65_536)
_LOOPBACK_OF: Final = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104  what a file may say


@dataclass(frozen=True, slots=True, order=True)
class Place:
    """The address that a server is bound to; 0.0.0.0 and :: stand for all addresses of the machine."""

    port: int
    host: str

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @property
    def url(self) -> str:
        """Its base URL on this machine."""
        return f"http://{Place(self.port, _LOOPBACK_OF.get(self.host, self.host))}"

    @property
    def is_everywhere(self) -> bool:
        """Whether the server answers at every address of the machine."""
        return self.host in _LOOPBACK_OF


def announce(place: Place) -> AbstractContextManager[object]:
    """Return a context that announces a server; it announces nothing where sockets cannot have names."""
    try:
        holder = socket.socket(socket.AF_UNIX)
    except OSError:
        return nullcontext()
    with suppress(OSError):
        holder.bind(f"\0{_PREFIX}{place}")
    return holder


def announced() -> tuple[Place, ...]:
    """Return the announced addresses by port. Any process can announce one, so ask what is there."""
    try:
        return places_in(_TABLE.read_bytes())
    except OSError:
        return ()


def places_in(table: bytes) -> tuple[Place, ...]:
    """Return the addresses in the kernel's table of names, by port, without malformed ones."""
    found = {_place(row["host"].decode(), int(row["port"])) for row in _ROW.finditer(table)}
    return tuple(sorted(place for place in found if place is not None)[:_MOST])


def _place(host: str, port: int) -> Place | None:
    try:
        address = str(ip_address(host.strip("[]")))
    except ValueError:
        return None
    return Place(port, address) if port in _PORTS else None
