"""A server on a port of its own, and clients that speak to it in bytes."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from syncrelay.config.listen import Listen
from syncrelay.explain import Tape
from syncrelay.status import RelayState, Taps
from syncrelay.status.server import Server

ANY = Listen("127.0.0.1", range(1))
_PATIENCE_S = 60


@contextmanager
def serving(state: RelayState, listen: Listen = ANY, taps: Taps | None = None) -> Iterator[tuple[str, int]]:
    """The address of a server that answers with one state."""
    with Server(listen) as server:
        server.serve(lambda: state, taps or Taps(Tape(), str))
        yield server.place.host, server.place.port


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
