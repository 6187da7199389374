"""Whoever speaks to the HTTP port, and however: sets go on, the port answers again, and tells nothing it should not."""

import random
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress

import pytest

from tests.faults.extent import chosen
from tests.faults.flow import Rig, accounts
from tests.faults.vitals import descriptors
from tests.ros.processes import Process, wait_until
from tests.ros.stage import Stage
from tests.ros.status import address

pytestmark = [pytest.mark.ros, pytest.mark.faults]

_CONNECTIONS = 1000
_GARBAGE = chosen(short=50, long=2000)
_PATIENCE_S = 60


def _place(relay: Process) -> tuple[str, int]:
    host, port = address(relay).removeprefix("http://").split(":")
    return host, int(port)


def _answer(place: tuple[str, int], request: bytes) -> bytes:
    """All that comes back; nothing where the connection is reset."""
    with socket.create_connection(place, timeout=_PATIENCE_S) as client, suppress(ConnectionError):
        client.sendall(request)
        with suppress(OSError):  # the other side may have ended the connection already
            client.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: client.recv(65_536), b""))
    return b""


def _requests() -> Iterator[bytes]:
    """Requests of which hardly one is right."""
    chance = random.Random(3)
    whole = b"GET /status HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"
    yield from (b"", b"\r\n" * 100, b"\0" * 1000, b"GET / HTTP/1.1\r\nHost: " + b"x" * 100_000)
    yield from (b"GET /" + b"../" * 50 + b"etc/passwd HTTP/1.1\r\n\r\n", b"GET /status?" + b"a=b&" * 2000)
    for lie in (b"Content-Length: 99999999999", b"Content-Length: -1", b"Transfer-Encoding: chunked"):
        yield b"POST /status HTTP/1.1\r\n" + lie + b"\r\n\r\nFFFFFFFFFFFF\r\nx"
    while True:
        request = bytearray(whole)
        for _ in range(chance.randrange(1, 8)):
            request[chance.randrange(len(request))] = chance.randrange(256)
        yield bytes(request[: chance.randrange(1, len(request) + 1)])


def test_a_thousand_clients_that_stall_and_requests_that_are_none_disturb_no_set(stage: Stage, figures):
    rig = Rig(stage)
    relay, witness, source = rig.relay(), rig.witness(), rig.source()
    source.match()
    source.pace(100)
    witness.wait_for_sets(100)
    place, before = _place(relay), descriptors(relay.pid)
    requests = _requests()
    with ExitStack() as stack:
        for number in range(_CONNECTIONS):
            client = stack.enter_context(socket.socket())
            client.settimeout(0)
            client.connect_ex(place)
            with suppress(BlockingIOError, ConnectionError):
                client.send(b"GET /status HTTP/1.1\r\nHost:"[: number % 30])
        began = time.time_ns()
        witness.wait_for_set_after(began)
        most = descriptors(relay.pid)
        # Those that stall are sent away in turn, until all have been.
        assert b" 200 OK" in _answer(place, b"GET /livez HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
    for _ in range(_GARBAGE):
        _answer(place, next(requests))
    witness.wait_for_set_after(time.time_ns())
    assert accounts(relay)
    assert witness.report().faults == []
    wait_until(lambda: descriptors(relay.pid) <= before + 1, "the connections to be closed")
    figures(
        f"{_CONNECTIONS} HTTP clients that stall ({most - before} of them at a time) and {_GARBAGE} requests that are"
        " none: sets went on, none wrong, and the port answers"
    )
