"""A relay of TCP in front of a server: it counts what comes back, and breaks connections off when it is told to."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread


class CountingRelay:
    """`received` are the bytes that came back; the next `to_break` answers of more than a kilobyte break off midway."""

    def __init__(self, port: int) -> None:
        self._to = port
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._listening.settimeout(0.05)
        self._ends = Event()
        self.port = self._listening.getsockname()[1]
        self.received = 0
        self.to_break = 0

    def serve(self) -> None:
        while not self._ends.is_set():
            with suppress(TimeoutError):
                client, _ = self._listening.accept()
                server = socket.create_connection(("127.0.0.1", self._to))
                Thread(target=self._copy, args=(client, server), daemon=True).start()
                Thread(target=self._copy_back, args=(server, client), daemon=True).start()
        self._listening.close()

    def end(self) -> None:
        self._ends.set()

    def _copy(self, client: socket.socket, server: socket.socket) -> None:
        with suppress(OSError):
            while content := client.recv(65536):
                server.sendall(content)
        with suppress(OSError):
            server.shutdown(socket.SHUT_WR)

    def _copy_back(self, server: socket.socket, client: socket.socket) -> None:
        with suppress(OSError), server, client:
            while content := server.recv(65536):
                self.received += len(content)
                if self.to_break and len(content) > 1024:
                    self.to_break -= 1
                    client.sendall(content[: len(content) // 2])
                    # A close alone waits for the thread that reads from it.
                    client.shutdown(socket.SHUT_RDWR)
                    return
                client.sendall(content)


@contextmanager
def counting_relay(port: int) -> Iterator[CountingRelay]:
    relay = CountingRelay(port)
    thread = Thread(target=relay.serve)
    thread.start()
    try:
        yield relay
    finally:
        relay.end()
        thread.join()
