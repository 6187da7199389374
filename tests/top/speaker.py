"""Servers that are not relays, and may send anything."""

import socket
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from threading import Event, Thread

HEAD = b"HTTP/1.1 200 OK\r\n\r\n"
Speech = Callable[[], Iterator[bytes]]


@contextmanager
def speaking(speech: Speech) -> Iterator[str]:
    """The base URL of a server that sends this on each connection and then closes it."""
    with closing(socket.create_server(("127.0.0.1", 0), backlog=128)) as listener:
        Thread(target=_accept, args=(listener, speech), daemon=True).start()
        try:
            yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        finally:
            # close() alone would not wake the thread in accept().
            listener.shutdown(socket.SHUT_RDWR)


@contextmanager
def answering(*bodies: bytes) -> Iterator[str]:
    """The base URL of a server that answers each request with the next of these, and finally always with the last."""
    left = list(bodies)
    with speaking(lambda: iter([HEAD, left.pop(0) if len(left) > 1 else left[0]])) as url:
        yield url


def slowly(chunk: bytes) -> Iterator[bytes]:
    """The same chunk again and again, with pauses shorter than any timeout."""
    pause = Event()
    while not pause.wait(0.02):
        yield chunk


def without_end(chunk: bytes) -> Iterator[bytes]:
    while True:
        yield chunk


def _accept(listener: socket.socket, speech: Speech) -> None:
    with suppress(OSError):
        while True:
            client, _ = listener.accept()
            Thread(target=_speak, args=(client, speech), daemon=True).start()


def _speak(client: socket.socket, speech: Speech) -> None:
    with closing(client), suppress(OSError):
        for chunk in speech():
            client.sendall(chunk)
        # Otherwise the client gets a reset if its request was not read.
        client.shutdown(socket.SHUT_WR)
        while client.recv(65_536):
            pass
