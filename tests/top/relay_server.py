"""A relay's HTTP side without a relay: serves whatever state it is given, on a real socket."""

from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

from syncrelay.status import RelayState, status_of


class RelayServer:
    """Serves the document of `state` at /status, and counts how often it was asked; `paths` has what is elsewhere.

    `stop` and `start` are a relay that goes and comes back.
    """

    def __init__(self, state: RelayState) -> None:
        self.body = status_of(state).as_json()
        self.paths: dict[str, bytes] = {}
        self.port = 0
        self.asked = 0
        self.start()

    def show(self, state: RelayState) -> None:
        self.body = status_of(state).as_json()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Listen, at the port that it had if it had one."""
        owner = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                found = {"/status": owner.body, **owner.paths}.get(self.path.partition("?")[0])
                owner.asked += 1
                self.send_response(404 if found is None else 200)
                self.end_headers()
                self.wfile.write(b"not here" if found is None else found)

            def log_message(self, *_words: object) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", self.port), Handler)
        self.port = self._server.server_address[1]
        Thread(target=self._server.serve_forever, args=(0.01,), daemon=True).start()

    def stop(self) -> None:
        self._server.shutdown()
        self._server.server_close()


@contextmanager
def serving(state: RelayState) -> Iterator[RelayServer]:
    server = RelayServer(state)
    try:
        yield server
    finally:
        server.stop()
