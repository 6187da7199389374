"""Where the relay listens for HTTP."""

import re
from dataclasses import dataclass
from typing import Final

from syncrelay.config.wording import quoted

DEFAULT_HOST: Final = "127.0.0.1"
DEFAULT_PORTS: Final = range(9464, 9474)
"""The first of them that is free; 9464 is the port of Prometheus exporters of OpenTelemetry."""

_LISTEN = re.compile(r"(?P<host>\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9.-]+):(?P<port>[0-9]{1,5})")
_MAX_PORT: Final = 65_535


@dataclass(frozen=True, slots=True)
class Listen:
    """A host, and the ports of which the first free one is taken; port 0 is any that is free.

    Where the file asks for nothing, `is_asked_for` is False, and a relay can go without.
    """

    host: str
    ports: range
    is_asked_for: bool = True

    def __str__(self) -> str:
        first, last = self.ports[0], self.ports[-1]
        return f"{self.host}:{first}" if first == last else f"{self.host}:{first} to {last}"


def parse_listen(text: str) -> Listen:
    """Return what `HOST:PORT` means. Raises ValueError saying what to write instead."""
    matched = _LISTEN.fullmatch(text)
    if matched is None:
        raise ValueError(f"expected HOST:PORT such as 127.0.0.1:9464, found {quoted(text)}")
    port = int(matched["port"])
    if port > _MAX_PORT:
        raise ValueError(f"port {port} is out of range, at most {_MAX_PORT}")
    return Listen(matched["host"].strip("[]"), range(port, port + 1))


def check_listen(text: str) -> str:
    """Return the text if it can be listened on. Raises ValueError."""
    parse_listen(text)
    return text
