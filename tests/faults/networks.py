"""Two machines in one: namespaces joined by a cable that can be made to fail. For root, where the kernel lets it."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

_TOOLS = ("ip", "tc", "iptables")
# A network that is nobody's: RFC 2544 keeps it for tests.
_ADDRESSES = ("198.18.77.1", "198.18.77.2")


def why_not() -> str | None:
    """Why no network can be made to fail here; None where one can."""
    missing = [tool for tool in _TOOLS if shutil.which(tool) is None]
    if os.geteuid() != 0 or missing:
        return f"needs root, and {', '.join(_TOOLS)}"
    try:
        with two_machines() as cable:
            cable.lose(0.1)
            cable.throttle("1mbit")
            return None
    except RuntimeError as error:
        return f"no network can be made to fail here: {error}"


@dataclass(frozen=True, slots=True)
class Cable:
    """What joins two namespaces. Faults are in the way of what the first one sends."""

    first: str
    second: str

    def enter(self, namespace: str) -> list[str]:
        """The words before a command that is to run in one of the namespaces."""
        return ["ip", "netns", "exec", namespace]

    def lose(self, share: float) -> None:
        """Lose this share of what the first sends, at random."""
        chance = ["-m", "statistic", "--mode", "random", "--probability", str(share)]
        self._in_second("iptables", "-A", "INPUT", "-i", "cable", *chance, "-j", "DROP")

    def lose_no_more(self) -> None:
        self._in_second("iptables", "-F", "INPUT")

    def throttle(self, rate: str) -> None:
        """Let through no more than a rate such as `1mbit`."""
        shaper = ["tbf", "rate", rate, "burst", "8kb", "latency", "50ms"]
        _run("ip", "netns", "exec", self.first, "tc", "qdisc", "add", "dev", "cable", "root", *shaper)

    def throttle_no_more(self) -> None:
        _run("ip", "netns", "exec", self.first, "tc", "qdisc", "del", "dev", "cable", "root")

    def cut(self) -> None:
        _run("ip", "-n", self.first, "link", "set", "cable", "down")

    def mend(self) -> None:
        _run("ip", "-n", self.first, "link", "set", "cable", "up")
        _route_multicast(self.first)

    def _in_second(self, *words: str) -> None:
        _run("ip", "netns", "exec", self.second, *words)


@contextmanager
def two_machines() -> Iterator[Cable]:
    """Two namespaces that see only each other, gone at the end."""
    names = [f"syncrelay-{place}-{os.getpid()}" for place in ("rig", "relay")]
    made: list[str] = []
    try:
        for name in names:
            _run("ip", "netns", "add", name)
            made.append(name)
        _run("ip", "-n", names[0], "link", "add", "cable", "type", "veth", "peer", "name", "cable", "netns", names[1])
        for name, address in zip(names, _ADDRESSES, strict=True):
            _run("ip", "-n", name, "address", "add", f"{address}/24", "dev", "cable")
            for link in ("lo", "cable"):
                _run("ip", "-n", name, "link", "set", link, "up")
            _route_multicast(name)
        yield Cable(*names)
    finally:
        for name in made:
            _run("ip", "netns", "delete", name)


def _route_multicast(name: str) -> None:
    """DDS finds others by multicast, which without a default route needs one of its own."""
    _run("ip", "-n", name, "route", "replace", "239.255.0.0/16", "dev", "cable")


def _run(*words: str) -> None:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)}: {done.stderr.strip()}")
