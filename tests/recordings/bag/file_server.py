"""A local HTTP server of files with range requests, which counts what it sends and fails as a test wants it to."""

import re
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from email.message import Message
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, Lock, Thread


class FileServer:
    """Files by path, with their `etags` and `dates`; `fault` names what is wrong with the answer to request n, from 0.

    `sent` is the number of bytes of content sent so far.
    """

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.etags: dict[str, str] = {}
        self.dates: dict[str, str] = {}
        self.has_ranges = True
        self.fault: Callable[[int], str] = lambda _: ""
        self.requests: list[str] = []
        self.sent = 0
        self.lock = Lock()
        self.ends = Event()
        self.port = 0

    def url(self, path: str) -> str:
        return f"http://127.0.0.1:{self.port}{path}"

    def forget(self) -> None:
        """Count from here."""
        self.requests.clear()
        self.sent = 0


@contextmanager
def file_server() -> Iterator[FileServer]:
    served = FileServer()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        timeout = 60
        # Otherwise a body waits 40 ms for the client to acknowledge its header.
        disable_nagle_algorithm = True

        def log_message(self, *_):
            pass

        def do_HEAD(self):
            _answer(self, served)

        def do_GET(self):
            _answer(self, served)

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, *_):
            """A client may go as it likes."""

    server = Server(("127.0.0.1", 0), Handler)
    served.port = server.server_address[1]
    thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield served
    finally:
        served.ends.set()
        server.shutdown()
        thread.join()
        server.server_close()


def _answer(request: BaseHTTPRequestHandler, served: FileServer) -> None:
    path = request.path.partition("?")[0]
    with served.lock:
        fault = served.fault(len(served.requests))
        served.requests.append(f"{request.command} {request.headers.get('Range', '')}".strip())
    if fault == "silent":
        served.ends.wait(60)
    etag, date = served.etags.get(path, '"one"'), served.dates.get(path, "Mon, 23 Nov 2026 05:00:00 GMT")
    if fault in ("drop", "silent"):
        _close(request)
    elif fault.isdigit():
        _say(request, int(fault))
    elif fault == "circle":
        _say(request, 302, Location=path)
    elif path not in served.files:
        _say(request, 404)
    elif not _is_as_expected(request.headers, etag, date):
        _say(request, 412)
    else:
        about = {"ETag": etag, "Last-Modified": date}
        _send(request, served, served.files[path], fault, {name: value for name, value in about.items() if value})


def _is_as_expected(asked: Message, etag: str, date: str) -> bool:
    """Whether a file is the one that a request expects. A weak tag is never one that is expected (RFC 9110, 13.1.1)."""
    if "If-Match" in asked:
        return asked["If-Match"] == etag and not etag.startswith("W/")
    return asked.get("If-Unmodified-Since", date) == date


def _send(
    request: BaseHTTPRequestHandler, served: FileServer, content: bytes, fault: str, headers: dict[str, str]
) -> None:
    wanted = re.fullmatch(r"bytes=(\d+)-(\d+)", request.headers.get("Range", ""))
    body, status = content, 200
    if wanted and served.has_ranges and fault != "whole":
        begin, end = int(wanted[1]) + (fault == "shifted"), min(int(wanted[2]) + 1, len(content))
        if begin >= len(content):
            _say(request, 416, **{"Content-Range": f"bytes */{len(content)}"})
            return
        body, status = content[begin:end], 206
        headers["Content-Range"] = f"bytes {begin}-{end - 1}/{len(content)}"
    if fault == "short" and request.command == "GET":
        body = body[: len(body) // 2]
    headers |= {"Connection": "close"} if fault == "endless" else {"Content-Length": str(len(body))}
    request.send_response(status)
    for name, value in headers.items():
        request.send_header(name, value)
    request.end_headers()
    if request.command == "HEAD":
        return
    if fault == "cut":
        body = body[: len(body) // 2]
    # Counted first: who has read all of it may look at once.
    with served.lock:
        served.sent += len(body)
    with suppress(OSError):
        request.wfile.write(body)
    if fault in ("cut", "endless"):
        _close(request)


def _say(request: BaseHTTPRequestHandler, status: int, **headers: str) -> None:
    request.send_response(status)
    for name, value in {**headers, "Content-Length": "0"}.items():
        request.send_header(name, value)
    request.end_headers()


def _close(request: BaseHTTPRequestHandler) -> None:
    """Break the connection off."""
    request.close_connection = True
    with suppress(OSError):
        request.wfile.flush()
    request.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    request.connection.close()
