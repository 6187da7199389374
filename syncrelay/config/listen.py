"""Where the relay listens for HTTP, and the host names that requests may use."""

import re
from dataclasses import dataclass
from ipaddress import IPv6Address, ip_address
from typing import Final

from syncrelay.config.wording import describe, quoted

DEFAULT_HOST: Final = "127.0.0.1"
DEFAULT_PORTS: Final = range(9464, 9474)
"""The first of them that is free; 9464 is the port of Prometheus exporters of OpenTelemetry."""

_LISTEN = re.compile(r"(?P<host>\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9.-]+):(?P<port>[0-9]{1,5})")
_MAX_PORT: Final = 65_535
_NAME = re.compile(r"[A-Za-z0-9_-]{1,63}(\.[A-Za-z0-9_-]{1,63})*\.?")
_LONGEST_NAME: Final = 254
_ADDRESS = re.compile(r"(?P<bracket>\[)?(?P<address>[0-9A-Fa-f:.]+(%[A-Za-z0-9._~-]+)?)(?(bracket)\])")


@dataclass(frozen=True, slots=True)
class Listen:
    """A host and a range of ports, of which the first free one is taken; port 0 means any free port.

    `is_asked_for` is False for the default, which a relay can do without. `hosts` are further names and addresses that
    requests may use, as parse_host returns them. `ready_share` is the share of its sets that a ready relay gives, if
    that matters.
    """

    host: str
    ports: range
    is_asked_for: bool = True
    hosts: tuple[str, ...] = ()
    ready_share: float | None = None

    def __str__(self) -> str:
        first, last = self.ports[0], self.ports[-1]
        return f"{self.host}:{first}" if first == last else f"{self.host}:{first} to {last}"


def parse_listen(text: str) -> Listen:
    """Return what `HOST:PORT` means. Raises ValueError saying what to write instead."""
    matched = _LISTEN.fullmatch(text)
    if matched is None or not _is_host(matched["host"]):
        raise ValueError(f"expected HOST:PORT such as 127.0.0.1:9464, found {quoted(text)}")
    port = int(matched["port"])
    if port > _MAX_PORT:
        raise ValueError(f"port {port} is out of range, at most {_MAX_PORT}")
    return Listen(matched["host"].strip("[]"), range(port, port + 1))


def check_listen(text: str) -> str:
    """Return the text if it can be listened on. Raises ValueError."""
    parse_listen(text)
    return text


def parse_host(text: str) -> str:
    """Return a host name or an address without its port in the one form that it is compared in.

    A name is in lower case and without its last dot, an address without brackets and zone; an IPv4 address in an
    IPv6 one is itself. Raises ValueError saying what to write instead.
    """
    address = _address(text)
    if address is not None:
        return address
    if len(text) > _LONGEST_NAME or _NAME.fullmatch(text) is None:
        raise ValueError(
            f"expected a host name or an address without a port, such as robot.local, found {describe(text)}"
        )
    # `127.0.0.1.` is an address too.
    name = text.removesuffix(".").lower()
    return _address(name) or name


def _is_host(text: str) -> bool:
    try:
        parse_host(text)
    except ValueError:
        return False
    return True


def _address(text: str) -> str | None:
    matched = _ADDRESS.fullmatch(text)
    try:
        address = ip_address(matched["address"]) if matched else None
    except ValueError:
        return None
    if isinstance(address, IPv6Address):
        return str(address.ipv4_mapped or IPv6Address(int(address)))
    return str(address) if address and matched and not matched["bracket"] else None
