"""A ROS domain id that nobody else on the machine uses."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# DDS derives its UDP ports from the domain id: 7400 + 250 * id and up. From id 102 on they fall into the
# range from which Linux gives out ephemeral ports (32768 to 60999), where any program may hold one already.
# 0 is everybody's default.
_IDS = range(1, 102)
_BASE, _PORTS_PER_DOMAIN = 7400, 250


@contextmanager
def claimed_domain() -> Iterator[int]:
    """Hold a domain id for as long as the context lasts.

    The claim is an abstract unix socket: it has the reach of DDS over loopback (one network namespace), it
    needs no file, and it ends with the process that holds it. Who knows nothing of claims is seen by the
    ports in use.
    """
    # Tests that run side by side begin at different ids, so that one's late farewells meet no newcomer.
    start = os.getpid() * 7
    for step in range(len(_IDS)):
        domain = _IDS[(start + step) % len(_IDS)]
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as claim:
            try:
                claim.bind(f"\0syncrelay-domain-{domain}")
            except OSError:
                continue
            if _udp_ports_in_use().isdisjoint(ports_of(domain)):
                yield domain
                return
    raise RuntimeError(f"every ROS domain id of {_IDS} is in use on this machine")


def ports_of(domain: int) -> range:
    """The UDP ports of a domain; Fast DDS numbers its shared-memory ports alike."""
    first = _BASE + _PORTS_PER_DOMAIN * domain
    return range(first, first + _PORTS_PER_DOMAIN)


def _udp_ports_in_use() -> set[int]:
    tables = [path for path in (Path("/proc/net/udp"), Path("/proc/net/udp6")) if path.exists()]
    rows = [row.split() for table in tables for row in table.read_text().splitlines()[1:]]
    return {int(row[1].rpartition(":")[2], 16) for row in rows}
