"""Refuses requests by a host name that is not the relay's, so that no web page reads its status (DNS rebinding).

Once a page is loaded, its server can have its own name resolve to 127.0.0.1 or to the robot. The browser then takes
the relay for the page's own server and lets the page read it. The requests still carry that name.
"""

import re
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any, Final, Self
from urllib.parse import urlsplit

from syncrelay.config import Listen
from syncrelay.config.listen import parse_host

REFUSAL: Final = "this relay does not answer to "
"""What the answer to a request by another name begins with."""

_AUTHORITY = re.compile(r"(?P<host>\[[^\[\]]*\]|[^:\[\]]*)(:[0-9]{0,5})?")
# HTTP/1.0 has no `Host`. Probes use it, browsers do not.
_WITHOUT_HOST: Final = "HTTP/1.0"


@dataclass(frozen=True, slots=True)
class Hosts:
    """The names that are answered to, as parse_host returns them; if `is_open`, so is any address."""

    named: frozenset[str]
    is_open: bool

    @classmethod
    def of(cls, listen: Listen, bound: str) -> Self:
        """Return the names of a server that is bound to an address, as the file's `listen` says.

        If other machines can reach it, it also answers to the machine's name and to any address: a router or a
        container engine may give it addresses that are not known here, and a page cannot redirect an address.
        """
        is_open = not ip_address(parse_host(bound)).is_loopback
        own = _of_this_machine() if is_open else ()
        return cls(frozenset(("localhost", parse_host(listen.host), *own, *listen.hosts)), is_open)

    def __contains__(self, host: str) -> bool:
        if host in self.named:
            return True
        try:
            address = ip_address(host)
        except ValueError:
            return False
        return self.is_open or address.is_loopback

    def refusal(self, environ: Mapping[str, Any]) -> tuple[str, str] | None:
        """Return the HTTP status and the sentence for a WSGI request that must be refused, else None."""
        try:
            named = _hosts_named(environ)
        except ValueError:
            return "400 Bad Request", "expected one `Host` header with a name or an address, and optionally a port"
        strange = next((host for host in named if host not in self), None)
        if strange is None:
            return None
        mend = f"if that is its name, write `metrics: {{hosts: [{strange}]}}` in its file and restart it"
        return "403 Forbidden", f"{REFUSAL}{strange}: {mend}"


def _hosts_named(environ: Mapping[str, Any]) -> tuple[str, ...]:
    """Return all hosts that a request names. Raises ValueError if one is malformed or missing."""
    target = environ["REQUEST_URI"]
    # A target that begins with two slashes is a path.
    in_target = "" if target.startswith("//") else urlsplit(target).netloc
    without = [] if environ["SERVER_PROTOCOL"] == _WITHOUT_HOST else [""]
    in_header = [environ["HTTP_HOST"]] if "HTTP_HOST" in environ else without
    return tuple(map(_host, [*in_header, in_target] if in_target else in_header))


def _host(authority: str) -> str:
    matched = _AUTHORITY.fullmatch(authority)
    return parse_host(matched["host"] if matched else authority)


def _of_this_machine() -> set[str]:
    """Return its name with and without domain, and as mDNS has it. DNS is not asked, which could take long."""
    full = socket.gethostname().lower().removesuffix(".")
    alone = full.partition(".")[0]
    return {full, alone, f"{alone}.local"}
