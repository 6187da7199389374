"""The relay's server on a port of its own, and clients that send bytes."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from syncrelay.config.listen import Listen
from syncrelay.explain import Tape
from syncrelay.status import RelayState, Taps
from syncrelay.status.server import Server

ANY = Listen("127.0.0.1", range(1))
_PATIENCE_S = 60


class Relay:
    """A relay's server without a relay. Its state may change, and it can go and come back at the same port."""

    def __init__(self, state: RelayState, listen: Listen = ANY, taps: Taps | None = None) -> None:
        self.state, self._listen, self._taps = state, listen, taps or Taps(Tape(), str)
        self.asked = 0
        self.start()

    def start(self) -> None:
        self._server = Server(self._listen)
        self.address = self._server.place.host, self._server.place.port
        self.url = self._server.place.url
        self._listen = replace(self._listen, ports=range(self.address[1], self.address[1] + 1))
        self._server.serve(self._tell, self._taps)

    def _tell(self) -> RelayState:
        self.asked += 1
        return self.state

    def stop(self) -> None:
        self._server.__exit__(None, None, None)


@contextmanager
def running(state: RelayState, listen: Listen = ANY, taps: Taps | None = None) -> Iterator[Relay]:
    relay = Relay(state, listen, taps)
    try:
        yield relay
    finally:
        relay.stop()


@contextmanager
def serving(state: RelayState, listen: Listen = ANY, taps: Taps | None = None) -> Iterator[tuple[str, int]]:
    """The address of a server that answers with one state."""
    with running(state, listen, taps) as relay:
        yield relay.address


def connected(address: tuple[str, int]) -> socket.socket:
    return socket.create_connection(address, timeout=_PATIENCE_S)


def sent(address: tuple[str, int], request: bytes) -> bytes:
    """All that comes back until the server ends the connection."""
    with connected(address) as client:
        client.sendall(request)
        return b"".join(iter(lambda: client.recv(65_536), b""))


def asked(address: tuple[str, int], path: str, *, method: str = "GET", host: str = "localhost") -> tuple[int, str]:
    """The status code and the body of one answer."""
    answer = sent(address, f"{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n".encode())
    head, _, body = answer.partition(b"\r\n\r\n")
    return int(head.split()[1]), body.decode()
