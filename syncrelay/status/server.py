"""The relay's HTTP: a page, /status, /tap, /metrics, /livez and /readyz, on threads of its own.

waitress reads and writes without blocking, so a client that stalls occupies a connection for a while and nothing else.
"""

import errno
import logging
import socket
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from threading import Event, Thread
from types import TracebackType
from typing import Any, Final, Self

from waitress.server import create_server
from waitress.wasyncore import close_all

from syncrelay.config import Listen
from syncrelay.config.wording import all_of
from syncrelay.errors import ListenError
from syncrelay.explain import GroupReport
from syncrelay.status.announcement import Place, announce
from syncrelay.status.hosts import Hosts
from syncrelay.status.metrics import exposition
from syncrelay.status.page import HEADERS, PATHS, page_file
from syncrelay.status.state import RelayState, is_ready
from syncrelay.status.taps import TapRefusedError, Taps

# An idle receive loop turns once a second, so one that has not for this long hangs.
_STALLED_S: Final = 5.0
# A reader of /status takes milliseconds.
_CLIENT_TIMEOUT_S: Final = 5
# Each takes a file descriptor, of a usual 1024. At this number, those that idled longest are closed.
_CONNECTIONS: Final = 256
_MAKING_ROOM: Final = 64
_HEADER_BYTES: Final = 16_384

_JSON: Final = "application/json"

PATHS_TOLD: Final[Mapping[str, str]] = {
    "/": "A page for browsers that shows what `syncrelay top` shows.",
    "/status": (
        "The state of the relay as JSON, in each group with the finding that explains most first. What is not known yet"
        " is null, such as a `type` that is to come from the graph."
    ),
    "/tap": "Each set and each dropped message as it leaves, in JSON; `syncrelay tap` reads it.",
    "/metrics": "The figures for Prometheus.",
    "/livez": f"200 while the receive loop turns, 503 once it has not for {_STALLED_S:.0f} s.",
    "/readyz": (
        "200 while the relay runs (not paused, not ending, and active if it is a managed node), no group is stopped or"
        " refused by DDS or lacks its bundle, and every required input has a publisher that fits; with"
        " `metrics: {ready: {share: 0.8}}` also only while every group gives that share of its possible sets. 503"
        " otherwise."
    ),
}
"""The paths and what they give; docs/reference/metrics.md is made of this."""

# Probes use any name for the relay, and a refusal would have it restarted. Their answers hold no state.
_PROBES: Final = ("/livez", "/readyz")

_Start = Callable[[str, list[tuple[str, str]]], Any]
_Answer = Callable[[dict[str, Any], _Start], Iterable[bytes]]


class Server:
    """Holds a port once it is made, answers and is announced once it serves, and ends on leaving its context."""

    def __init__(self, listen: Listen) -> None:
        """Take the port, or the first free one of the usual ports if the file names none. Raises ListenError."""
        # waitress warns of clients that go away, which does not concern the robot's operator.
        logging.getLogger("waitress").setLevel(logging.CRITICAL)
        self._socket = _bound(listen)
        host, port = self._socket.getsockname()[:2]
        self.place = Place(port, host)
        self._hosts = Hosts.of(listen, host)
        self._announcement: AbstractContextManager[object] = nullcontext()
        # The sockets that waitress watches, by their descriptors.
        self._channels: dict[int, Any] = {}
        self._server: Any = None
        self._ends = Event()
        self._thread: Thread | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._announcement.__exit__(kind, error, trace)
        if self._thread is not None:
            self._server.task_dispatcher.shutdown()
            self._ends.set()
            # Wakes the loop. What it waits on stays open until it has ended: it may have been woken already.
            self._server.pull_trigger()
            self._thread.join()
            close_all(self._channels)
        self._socket.close()

    def serve(self, state: Callable[[], RelayState], taps: Taps) -> None:
        """Begin to answer; `state` is called on other threads."""
        self._server = create_server(
            _application(state, taps, self._hosts),
            map=self._channels,
            sockets=[self._socket],
            threads=2,
            connection_limit=_CONNECTIONS,
            channel_timeout=_CLIENT_TIMEOUT_S,
            cleanup_interval=1,
            max_request_header_size=_HEADER_BYTES,
            max_request_body_size=_HEADER_BYTES,
            asyncore_use_poll=True,
            ident=None,
            clear_untrusted_proxy_headers=True,
        )
        self._thread = Thread(target=self._run, name="syncrelay-http")
        self._thread.start()
        self._announcement = announce(self.place)

    def _run(self) -> None:
        while not self._ends.is_set():
            if len(self._channels) >= _CONNECTIONS:
                self._make_room()
            self._server.asyncore.loop(timeout=1, map=self._channels, use_poll=True, count=1)

    def _make_room(self) -> None:
        """Close the connections that idled longest, as waitress does once they time out."""
        idle = [each for each in self._server.active_channels.values() if not each.requests]
        for each in sorted(idle, key=lambda channel: channel.last_activity)[:_MAKING_ROOM]:
            each.will_close = True


def _bound(listen: Listen) -> socket.socket:
    family = socket.AF_INET6 if ":" in listen.host else socket.AF_INET
    for port in listen.ports:
        bound = socket.socket(family, socket.SOCK_STREAM)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            bound.bind((listen.host, port))
            bound.listen()
        except OSError as error:
            bound.close()
            if error.errno != errno.EADDRINUSE:
                raise ListenError(f"cannot listen on {listen}: {error.strerror}") from error
        else:
            return bound
    raise ListenError(
        f"cannot listen on {listen}: another process uses it;"
        " set another `listen` in `metrics`, or write `metrics: null` to run without"
    )


def _application(state: Callable[[], RelayState], taps: Taps, hosts: Hosts) -> _Answer:
    answers: dict[str, _Answer] = {
        **{path: _of_page(path) for path in PATHS},
        "/metrics": lambda environ, start: _answer(
            start, "200 OK", *exposition(state(), environ.get("HTTP_ACCEPT", ""))
        ),
        "/status": lambda _, start: _answer(start, "200 OK", _status(state()), _JSON),
        "/tap": lambda environ, start: _tapped(start, taps, environ["QUERY_STRING"], state),
        "/livez": lambda _, start: _liveness(start, state()),
        "/readyz": lambda _, start: _readiness(start, state()),
    }

    def answered(environ: dict[str, Any], start: _Start) -> Iterable[bytes]:
        if environ["REQUEST_METHOD"] not in ("GET", "HEAD"):
            return _text(start, "405 Method Not Allowed", "only GET")
        path = environ["PATH_INFO"]
        refusal = None if path in _PROBES else hosts.refusal(environ)
        if refusal is not None:
            return _text(start, *refusal)
        answer = answers.get(path)
        if answer is None:
            return _text(start, "404 Not Found", f"there are {all_of(PATHS_TOLD)}")
        return answer(environ, start)

    def application(environ: dict[str, Any], start: _Start) -> Iterable[bytes]:
        body = answered(environ, start)
        return [] if environ["REQUEST_METHOD"] == "HEAD" else body

    return application


def _status(state: RelayState) -> bytes:
    from syncrelay.status.as_document import status_of  # noqa: PLC0415  it may never be asked for

    return status_of(state).as_json()


def _liveness(start: _Start, state: RelayState) -> list[bytes]:
    if state.turned_s < _STALLED_S:
        return _text(start, "200 OK", "receiving")
    return _text(start, "503 Service Unavailable", f"the receive loop last turned {state.turned_s:.0f} s ago")


def _readiness(start: _Start, state: RelayState) -> list[bytes]:
    if is_ready(state):
        return _text(start, "200 OK", "ready")
    return _text(start, "503 Service Unavailable", f"not ready: {state.phase.value}, see /status")


def _of_page(path: str) -> _Answer:
    def answer(_environ: dict[str, Any], start: _Start) -> Iterable[bytes]:
        content_type, content = page_file(path)
        return _answer(start, "200 OK", content, content_type, *HEADERS)

    return answer


def _tapped(start: _Start, taps: Taps, query: str, state: Callable[[], RelayState]) -> list[bytes]:
    def reports() -> dict[str, GroupReport | None]:
        now = state()
        return {**{report.facts.name: report for report in now.groups}, **dict.fromkeys(now.unjudged)}

    try:
        return _answer(start, "200 OK", taps.answer(query, reports=reports), _JSON)
    except TapRefusedError as error:
        return _text(start, error.status, str(error))


def _text(start: _Start, status: str, text: str) -> list[bytes]:
    return _answer(start, status, f"{text}\n".encode(), "text/plain; charset=utf-8")


def _answer(start: _Start, status: str, body: bytes, content_type: str, *more: tuple[str, str]) -> list[bytes]:
    told = [("Content-Type", content_type), ("Content-Length", str(len(body))), ("Cache-Control", "no-store")]
    start(status, [*told, *more])
    return [body]
