"""How nodes find each other: the variables of ROS, as rcl reads them."""

import socket
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from syncrelay.config.wording import did_you_mean, quoted
from syncrelay.doctor.diagnosis import Diagnosis, error, info
from syncrelay.environment.domain import DISCOVERY_RANGES, DOMAIN_ADVICE, domain_of, no_domain, ports_of, range_of

_LOCALHOST_ONLY: Final = "ROS_LOCALHOST_ONLY"
_RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PEERS: Final = "ROS_STATIC_PEERS"
# Linux's own default.
_EPHEMERAL: Final = (32768, 60999)


def peers_of(environ: Mapping[str, str]) -> tuple[str, ...]:
    """Return the hosts that ROS_STATIC_PEERS names."""
    return tuple(peer for peer in environ.get(_PEERS, "").split(";") if peer)


def check_discovery(
    environ: Mapping[str, str], *, ephemeral_ports: tuple[int, int] | None = None
) -> Iterator[Diagnosis]:
    """Yield variables that ROS refuses or misreads, or that limit which nodes it finds.

    `ephemeral_ports` are those that Linux gives out by itself, by default this machine's.
    """
    yield from _domain(environ, ephemeral_ports or _ephemeral_ports())
    yield from _range(environ)
    yield from _localhost_only(environ)
    if unresolved := [peer for peer in peers_of(environ) if not _resolves(peer)]:
        yield error(
            "static_peers",
            f"ROS_STATIC_PEERS: no address found for {', '.join(map(quoted, unresolved))}",
            impact="no node starts until every peer has an address",
            fix="write IP addresses, or names that this machine can resolve, separated by ;",
        )


def _domain(environ: Mapping[str, str], ephemeral_ports: tuple[int, int]) -> Iterator[Diagnosis]:
    text = environ.get("ROS_DOMAIN_ID", "")
    domain = domain_of(environ)
    if domain is None:
        yield error(
            "domain_id",
            no_domain(environ),
            impact="no node starts with it, or it starts on a domain that nobody meant",
            fix=DOMAIN_ADVICE,
        )
        return
    if text and text.strip() != str(domain):
        yield error(
            "domain_id",
            f"ROS_DOMAIN_ID={text} is read as {domain}",
            impact=f"ROS reads numbers as C does, so these nodes find only others on domain {domain}",
            fix="write the number in plain digits, without a leading 0 and with nothing after it",
        )
    low, high = ephemeral_ports
    ports = ports_of(domain)
    # By its first ports: of the last ones of 250 only the hundredth node makes use.
    if low <= ports[0] <= high:
        yield info(
            "domain_ports",
            f"ROS_DOMAIN_ID={domain} uses UDP ports {ports[0]} to {ports[-1]}, which Linux also gives to any program",
            impact="now and then a node does not start or is not found, because its port is taken",
            fix="use a domain from 0 to 101 on all machines",
        )


def _range(environ: Mapping[str, str]) -> Iterator[Diagnosis]:
    asked = environ.get(_RANGE, "")
    if asked and asked not in DISCOVERY_RANGES:
        yield error(
            "discovery_range",
            f"{_RANGE}={asked} is unknown{did_you_mean(asked, DISCOVERY_RANGES)}",
            impact="ROS takes it as LOCALHOST: nodes on other machines are not found",
            fix=f"export {_RANGE}=SUBNET    (default), LOCALHOST, OFF or SYSTEM_DEFAULT, in capitals",
        )
    elif range_of(environ) == "OFF":
        yield error(
            "discovery_off",
            f"{_RANGE}=OFF",
            impact="nodes find no others, not even on this machine",
            fix=f"unset {_RANGE}",
        )
    elif asked == "SYSTEM_DEFAULT":
        yield info(
            "discovery_range",
            f"{_RANGE}=SYSTEM_DEFAULT leaves discovery to the middleware's own configuration",
            impact="which nodes are found depends on its profiles file, and ROS_STATIC_PEERS has no effect",
            fix=f"nothing if that is intended; otherwise: unset {_RANGE}",
        )
    elif asked == "LOCALHOST" and not peers_of(environ):
        yield info(
            "discovery_range",
            f"{_RANGE}=LOCALHOST",
            impact="only nodes on this machine are found",
            fix=f"nothing if the robot is this machine; otherwise: unset {_RANGE}",
        )


def _localhost_only(environ: Mapping[str, str]) -> Iterator[Diagnosis]:
    if environ.get(_LOCALHOST_ONLY) != "1":
        return
    overruled = [
        name for name in (_RANGE, _PEERS) if environ.get(name) and (name, environ[name]) != (_RANGE, "LOCALHOST")
    ]
    if overruled:
        yield error(
            "localhost_only",
            f"{_LOCALHOST_ONLY}=1 overrules {' and '.join(overruled)}",
            impact="only nodes on this machine are found, whatever the other variables say",
            fix=f"unset {_LOCALHOST_ONLY}    (deprecated since Jazzy)",
        )
    else:
        yield info(
            "localhost_only",
            f"{_LOCALHOST_ONLY}=1 is deprecated",
            impact="it still works: only nodes on this machine are found",
            fix=f"write {_RANGE}=LOCALHOST instead, or unset it to find other machines",
        )


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
