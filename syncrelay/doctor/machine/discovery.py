"""What discovery's variables name: peers' addresses, a profiles file, and the ports that Linux gives out."""

import socket
from collections.abc import Mapping
from pathlib import Path
from typing import Final
from xml.parsers import expat

from syncrelay.doctor.discovery import Discovery, peers_of
from syncrelay.doctor.transport import Transport
from syncrelay.environment.transport import PROFILES

_EPHEMERAL: Final = (32768, 60999)


def look_at_discovery(environ: Mapping[str, str]) -> Discovery:
    """Return the variables with what they name, as it is found now."""
    return Discovery(environ, _ephemeral_ports(), tuple(peer for peer in peers_of(environ) if not _resolves(peer)))


def look_at_transport(environ: Mapping[str, str]) -> Transport:
    """Return Fast DDS's variables, and what is wrong with the files that they name."""
    named = ((name, Path(environ[name])) for name in PROFILES if environ.get(name))
    return Transport(environ, tuple((name, fault) for name, path in named if (fault := _xml_fault(path))))


def _ephemeral_ports() -> tuple[int, int]:
    try:
        low, high = Path("/proc/sys/net/ipv4/ip_local_port_range").read_text(encoding="ascii").split()
    except OSError:
        return _EPHEMERAL
    return int(low), int(high)


def _resolves(host: str) -> bool:
    try:
        return bool(socket.getaddrinfo(host, None))
    except (OSError, UnicodeError):
        return False


def _xml_fault(path: Path) -> str | None:
    try:
        expat.ParserCreate().Parse(path.read_bytes(), True)  # noqa: FBT003  expat's signature: this is all of it
    except OSError as error:
        return error.strerror
    except expat.ExpatError as error:
        return f"is not XML: {error}"
    return None
