"""Asks relays for their status over HTTP, and finds relays."""

import socket
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection, IncompleteRead
from threading import Event, Timer
from typing import Final
from urllib.parse import urlsplit

from syncrelay.config.listen import DEFAULT_HOST, DEFAULT_PORTS
from syncrelay.errors import SyncRelayError, UsageError
from syncrelay.printable import printable
from syncrelay.status.announcement import Place, announced
from syncrelay.status.document import NotAStatusError, Status, read_status
from syncrelay.status.hosts import REFUSAL

_TIMEOUT_S: Final = 2.0
# A relay that is starting, or a machine under load, takes longer for the first answer.
_SEARCH_TIMEOUT_S: Final = 5.0
# Enough for a large status over a slow network; bounds what comes byte by byte or never ends.
_WHOLE_S: Final = 10.0
_MOST_BYTES: Final = 64_000_000
_MOST_WORDS: Final = 500
_AT_ONCE: Final = 64


class NoAnswerError(SyncRelayError):
    """Nothing answers there."""


class NobodyListensError(NoAnswerError):
    """The machine is there, but nothing listens at the port."""


class OtherServerError(SyncRelayError):
    """Something answers, but not as a relay does."""


@dataclass(frozen=True, slots=True)
class Answer:
    """The status of a relay, and the document that it came in."""

    url: str
    document: bytes
    status: Status


@dataclass(frozen=True, slots=True)
class Search:
    """The relays that were found, and a sentence for each other place where something answers or fails."""

    relays: tuple[Answer, ...]
    others: tuple[str, ...]


def ask(url: str, *, timeout_s: float = _TIMEOUT_S, whole_s: float = _WHOLE_S) -> Answer:
    """Get the status of the relay at a base URL such as http://robot:9464.

    Raises NoAnswerError if nothing arrives for `timeout_s`, or not everything within `whole_s`, and OtherServerError if
    something else answers.
    """
    with closing(connection_to(url, timeout_s)) as connection:
        body = get(connection, f"{urlsplit(url).path}/status", whole_s=whole_s)
    try:
        return Answer(url, body, read_status(body))
    except NotAStatusError as error:
        raise OtherServerError(
            f"what listens there is not a relay, or runs another version ({printable(str(error))})"
        ) from error


def connection_to(url: str, timeout_s: float = _TIMEOUT_S) -> HTTPConnection:
    """Return a connection that is made when it is first used. Proxies of the environment are not used."""
    parts = urlsplit(url)
    return (HTTPSConnection if parts.scheme == "https" else HTTPConnection)(parts.netloc, timeout=timeout_s)


def get(connection: HTTPConnection, target: str, *, whole_s: float = _WHOLE_S) -> bytes:
    """Get what is at a path. Raises as `ask` does, also where the server closed a connection that idled."""
    try:
        if connection.sock is None:
            connection.connect()
        with _ended_after(connection.sock, whole_s):
            connection.request("GET", target)
            with connection.getresponse() as response:
                status, reason, body = response.status, response.reason, _body(response)
    except (OSError, IncompleteRead, UnicodeError) as error:
        raise _no_answer(error, connection.timeout or 0) from error
    except (HTTPException, ValueError) as error:
        # http.client raises ValueError for a chunk of a negative size.
        raise OtherServerError("what listens there is not a relay: its answer is not HTTP") from error
    if status != HTTPStatus.OK:
        raise OtherServerError(_refused(f"{status} {reason}", body))
    return body


def _body(response: HTTPResponse) -> bytes:
    most = _MOST_BYTES if response.status == HTTPStatus.OK else _MOST_WORDS
    body = response.read(most)
    # http.client does not report that read(n) came short.
    if response.length and len(body) < most:
        raise IncompleteRead(body, response.length)
    return body


@contextmanager
def _ended_after(connected: socket.socket, whole_s: float) -> Iterator[None]:
    """Shut a connection down after `whole_s`, however steadily data arrives. Raises NoAnswerError then."""
    is_over = Event()

    def end() -> None:
        is_over.set()
        with suppress(OSError):
            connected.shutdown(socket.SHUT_RDWR)

    timer = Timer(whole_s, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        if is_over.is_set():
            raise NoAnswerError(f"no complete answer within {whole_s:g} s")


def _refused(answer: str, body: bytes) -> str:
    words = printable(body.decode(errors="replace").strip())
    if words.startswith(REFUSAL):
        return words
    return f"what listens there is not a relay: it answers {printable(answer)}"


def search(urls: Sequence[str], *, timeout_s: float = _SEARCH_TIMEOUT_S, whole_s: float = _WHOLE_S) -> Search:
    """Ask all URLs at once. Among several, those where nothing listens are not reported."""

    def answer_or_error(url: str) -> Answer | SyncRelayError:
        try:
            return ask(url, timeout_s=timeout_s, whole_s=whole_s)
        except (NoAnswerError, OtherServerError) as error:
            return error

    with ThreadPoolExecutor(min(len(urls), _AT_ONCE)) as pool:
        answers = list(pool.map(answer_or_error, urls))
    others = [
        f"{url}: {answer}"
        for url, answer in zip(urls, answers, strict=True)
        if not isinstance(answer, Answer) and (len(urls) == 1 or not isinstance(answer, NobodyListensError))
    ]
    return Search(tuple(answer for answer in answers if isinstance(answer, Answer)), tuple(others))


def base_urls(named: str | None) -> list[str]:
    """Return the base URLs to ask: those that this machine's relays announce, or the usual ports of a named host.

    `named` is a host, host:port or URL; with a port it is the only place. Raises UsageError if it is none of them.
    """
    if named is None:
        return _on_this_machine()
    try:
        parts = urlsplit(named if "://" in named else f"http://{named}")
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise UsageError(f"--url {named}: {error}") from error
    if parts.scheme not in {"http", "https"} or not host or not named.isprintable() or " " in named:
        raise UsageError(f"--url {named}: expected a host, host:port or http://host:port")
    path = parts.path.rstrip("/").removesuffix("/status")
    if port is None and parts.scheme == "http" and not path:
        return [f"http://{f'[{host}]' if ':' in host else host}:{port}" for port in DEFAULT_PORTS]
    return [f"{parts.scheme}://{parts.netloc}{path}"]


def _on_this_machine() -> list[str]:
    """Return where relays announce themselves, and the usual ports: announcements do not leave a container."""
    places = set(announced())
    everywhere = {place.port for place in places if place.is_everywhere}
    unannounced = {Place(port, DEFAULT_HOST) for port in DEFAULT_PORTS if port not in everywhere}
    return list(dict.fromkeys(place.url for place in sorted(places | unannounced)))


def _no_answer(error: Exception, timeout_s: float) -> NoAnswerError:
    match error:
        case ConnectionRefusedError():
            return NobodyListensError("nothing listens there")
        case TimeoutError():
            return NoAnswerError(f"no answer within {timeout_s:g} s")
        case socket.gaierror():
            return NoAnswerError("no machine with that name was found")
        case IncompleteRead() | ConnectionError():
            return NoAnswerError("the connection closed before the answer was complete")
        case OSError(strerror=str() as words):
            return NoAnswerError(words)
        case _:
            return NoAnswerError(str(error) or type(error).__name__)
