"""Asks relays for their state over HTTP, and finds out where relays are."""

import socket
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from http.client import HTTPException
from typing import Final
from urllib.error import HTTPError, URLError
from urllib.parse import urlsplit
from urllib.request import ProxyHandler, build_opener

from syncrelay.errors import SyncRelayError, UsageError
from syncrelay.printable import printable
from syncrelay.top.state import NotAStateError, State, read_state

FIRST_PORT: Final = 9464
LAST_PORT: Final = 9473
"""Where a relay listens unless its file says otherwise: at the first of these that is free."""
_TIMEOUT_S: Final = 2.0
# A relay that is just starting, or a machine under load, takes longer to be found than to be asked again.
_SEARCH_TIMEOUT_S: Final = 5.0
_MOST_BYTES: Final = 64_000_000
# A robot is asked directly: a proxy that the environment names is for the world outside.
_OPENER: Final = build_opener(ProxyHandler({}))


class NoAnswerError(SyncRelayError):
    """Nothing answers there."""


class NobodyListensError(NoAnswerError):
    """There is a machine, and no server at the port."""


class OtherServerError(SyncRelayError):
    """Something answers, but not as a relay does."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a relay says of itself: the document as it came, and what it holds."""

    url: str
    document: bytes
    state: State


@dataclass(frozen=True, slots=True)
class Search:
    """What was found: relays, and in words what else there was at the places where they are looked for."""

    relays: tuple[Answer, ...]
    others: tuple[str, ...]


def ask(url: str, *, timeout_s: float = _TIMEOUT_S) -> Answer:
    """Get the state of the relay at a base URL such as http://robot:9464.

    Raises NoAnswerError where nothing answers in time, OtherServerError where something else does.
    """
    try:
        with _OPENER.open(f"{url}/status", timeout=timeout_s) as response:
            document = response.read(_MOST_BYTES)
    except HTTPError as error:
        error.close()
        answer = printable(f"{error.code} {error.reason}")
        raise OtherServerError(f"what listens there is no relay: it answers {answer}") from error
    except (OSError, HTTPException, UnicodeError) as error:
        raise _no_answer(error, timeout_s) from error
    try:
        return Answer(url, document, read_state(document))
    except NotAStateError as error:
        raise OtherServerError(f"what listens there is no relay, or one of another version ({error})") from error


def search(urls: Sequence[str]) -> Search:
    """Ask all at once. Of several, those where nobody listens are not worth a word."""
    with ThreadPoolExecutor(len(urls)) as pool:
        answers = list(pool.map(_ask_or_error, urls))
    told = [
        f"{url}: {answer}"
        for url, answer in zip(urls, answers, strict=True)
        if not isinstance(answer, Answer) and (len(urls) == 1 or not isinstance(answer, NobodyListensError))
    ]
    return Search(tuple(answer for answer in answers if isinstance(answer, Answer)), tuple(told))


def _ask_or_error(url: str) -> Answer | SyncRelayError:
    try:
        return ask(url, timeout_s=_SEARCH_TIMEOUT_S)
    except (NoAnswerError, OtherServerError) as error:
        return error


def base_urls(named: str | None) -> list[str]:
    """Return where to look: at the ports that relays take by themselves, on this machine or the one named.

    `named` is a host, host:port or URL; with a port it is the only place. Raises UsageError where it is none of them.
    """
    if named is None:
        return _at_usual_ports("127.0.0.1")
    try:
        parts = urlsplit(named if "://" in named else f"http://{named}")
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise UsageError(f"--url {named}: {error}") from error
    if parts.scheme not in {"http", "https"} or not host:
        raise UsageError(f"--url {named}: expected a host, host:port or http://host:port")
    path = parts.path.rstrip("/").removesuffix("/status")
    if port is None and parts.scheme == "http" and not path:
        return _at_usual_ports(f"[{host}]" if ":" in host else host)
    return [f"{parts.scheme}://{parts.netloc}{path}"]


def _at_usual_ports(host: str) -> list[str]:
    return [f"http://{host}:{port}" for port in range(FIRST_PORT, LAST_PORT + 1)]


def _no_answer(error: Exception, timeout_s: float) -> NoAnswerError:
    reason = error.reason if isinstance(error, URLError) and isinstance(error.reason, Exception) else error
    match reason:
        case ConnectionRefusedError():
            return NobodyListensError("nothing listens there")
        case TimeoutError():
            return NoAnswerError(f"no answer within {timeout_s:g} s")
        case socket.gaierror():
            return NoAnswerError("no machine of that name is known")
        case OSError(strerror=str() as words):
            return NoAnswerError(words)
        case _:
            return NoAnswerError(printable(str(reason)) or type(reason).__name__)
