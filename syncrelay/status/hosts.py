"""By which names the relay is asked: a page in a browser must not read its state under a name of its own.

Who serves a page may have the name of its server lead to 127.0.0.1, or to the robot, once it is loaded (DNS
rebinding): to the browser what answers there is the page's own server. Its requests still carry that name.
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
# It had no `Host` yet, and no browser speaks it; probes do.
_WITHOUT_HOST: Final = "HTTP/1.0"


@dataclass(frozen=True, slots=True)
class Hosts:
    """Names and addresses, as parse_host returns them, and how far any address is one of them."""

    named: frozenset[str]
    is_open: bool

    @classmethod
    def of(cls, listen: Listen, bound: str) -> Self:
        """Return those of a server at the address `bound` that the file's `listen` led to.

        Beyond this machine it goes by the machine's name, and by any address: which ones a router or a container
        engine gives it is not known here, and no page can have one lead elsewhere.
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
        """Return the HTTP status and the sentence for a WSGI request that is not to be answered."""
        try:
            asked = _asked(environ)
        except ValueError:
            return "400 Bad Request", "expected one `Host` header with a name or an address, and optionally a port"
        strange = next((host for host in asked if host not in self), None)
        if strange is None:
            return None
        mend = f"if that is its name, write `metrics: {{hosts: [{strange}]}}` in its file and restart it"
        return "403 Forbidden", f"{REFUSAL}{strange}: {mend}"


def _asked(environ: Mapping[str, Any]) -> tuple[str, ...]:
    """Return all hosts that a request names. Raises ValueError where one is none, or there should be one."""
    target = environ["REQUEST_URI"]
    # What begins with two slashes is a path to the server.
    in_target = "" if target.startswith("//") else urlsplit(target).netloc
    without = [] if environ["SERVER_PROTOCOL"] == _WITHOUT_HOST else [""]
    in_header = [environ["HTTP_HOST"]] if "HTTP_HOST" in environ else without
    return tuple(map(_host, [*in_header, in_target] if in_target else in_header))


def _host(authority: str) -> str:
    matched = _AUTHORITY.fullmatch(authority)
    return parse_host(matched["host"] if matched else authority)


def _of_this_machine() -> set[str]:
    """Return its name, in full and alone and as mDNS knows it; to ask DNS for more could take long."""
    full = socket.gethostname().lower().removesuffix(".")
    alone = full.partition(".")[0]
    return {full, alone, f"{alone}.local"}
