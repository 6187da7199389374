"""A file on an HTTP server, by ranges: each answer is held against what was asked for, and the file as it was."""

import re
from asyncio import IncompleteReadError
from collections.abc import Awaitable, Callable
from errno import ENOSPC
from typing import Any, BinaryIO, Final, TypeVar

import aiohttp
import fsspec
from fsspec.asyn import sync
from fsspec.config import conf

from syncrelay.recordings.bag.attempts import REPLACED, LastingError, PassingError, Patience

_Done = TypeVar("_Done")
_FIRST: Final = 16
_PIECE: Final = 1_000_000
_RANGE: Final = re.compile(r"bytes (\d+)-(\d+)/(\d+|\*)")
_CONNECT_WITHIN: Final = 15.0
# Slower is as good as none: bytes a second.
_LEAST_RATE: Final = 50_000
_PARTIAL, _OUT_OF_RANGE = 206, 416
_DENIED: Final = "check the credentials, and whether a signed URL has expired"
_LASTING: Final = {
    401: f"access denied (401): {_DENIED}",
    403: f"access denied (403): {_DENIED}",
    404: "no such file on the server (404): check the URL",
    410: "no such file on the server (410): check the URL",
    412: REPLACED,
}
_PASSING: Final = (408, 421, 425, 429)
_SERVER_ERRORS: Final = 500
_OK: Final = 200


class HttpFile:
    """A file behind a URL; see Ranges."""

    def __init__(self, url: str, patience: Patience) -> None:
        """Ask for the first bytes; raises PassingError or LastingError."""
        # What is configured for fsspec stands; without, proxies and .netrc are as for other programs.
        asked = conf.get("https", {}).get("client_kwargs", {})
        settings = {"trust_env": True, **asked}
        # What is percent-encoded was signed so.
        self._files = fsspec.filesystem("https", client_kwargs=settings, encoded="%" in url, use_listings_cache=False)
        self._url = url
        self._patience = patience
        self.identity = ""
        self.size = -1
        self.has_ranges = True
        self._run(lambda: self._ask({"Range": f"bytes=0-{_FIRST - 1}"}, self._begin, _FIRST))

    def fetch(self, begin: int, end: int) -> bytes:
        """See Ranges."""
        ranges = {"Range": f"bytes={begin}-{end - 1}"}
        return self._run(lambda: self._ask(ranges, lambda answer: self._part(answer, begin, end), end - begin))

    def fetch_all(self, file: BinaryIO) -> None:
        """See Ranges."""
        file.seek(0)
        file.truncate()
        self._run(lambda: self._ask({}, lambda answer: self._whole(answer, file), max(self.size, 0)))

    def _run(self, work: Callable[[], Awaitable[_Done]]) -> _Done:
        try:
            done: _Done = sync(self._files.loop, work)
        except aiohttp.InvalidURL as error:
            raise LastingError("is no URL of a server: check it") from error
        except aiohttp.ClientSSLError as error:
            raise LastingError(
                "the server's certificate is not trusted here: check the URL, and SSL_CERT_FILE"
            ) from error
        except (aiohttp.ClientError, IncompleteReadError, OSError, EOFError) as error:
            if isinstance(error, OSError) and error.errno == ENOSPC:
                raise
            raise PassingError(_why(error, self._patience)) from error
        return done

    async def _ask(
        self, headers: dict[str, str], take: Callable[[aiohttp.ClientResponse], Awaitable[_Done]], size: int
    ) -> _Done:
        session = await self._files.set_session()
        within = self._patience.answer_within
        limits = aiohttp.ClientTimeout(
            total=within + size / _LEAST_RATE, sock_connect=min(within, _CONNECT_WITHIN), sock_read=within
        )
        options: dict[str, Any] = {**self._files.kwargs, "timeout": limits}
        # Ranges are those of the file and not of a compressed form of it.
        options["headers"] = {**options.get("headers", {}), **headers, "Accept-Encoding": "identity"}
        async with session.get(self._files.encode_url(self._url), **options) as answer:
            if answer.status in _LASTING:
                raise LastingError(_LASTING[answer.status])
            if answer.status in _PASSING or answer.status >= _SERVER_ERRORS:
                raise PassingError(f"the server answered {answer.status}")
            return await take(answer)

    async def _begin(self, answer: aiohttp.ClientResponse) -> None:
        """Learn the size of the file, what tells it from another, and whether the server has ranges."""
        self.identity = _identity(answer)
        told = _RANGE.fullmatch(answer.headers.get("Content-Range", ""))
        if answer.status == _PARTIAL and told and told[3] != "*":
            self.size = int(told[3])
        elif answer.status == _OUT_OF_RANGE:
            self.size = 0
        elif answer.status == _OK:
            self.has_ranges = False
            self.size = _length(answer)
        else:
            raise _unexpected(answer)

    async def _part(self, answer: aiohttp.ClientResponse, begin: int, end: int) -> bytes:
        if _identity(answer) != self.identity or answer.status == _OUT_OF_RANGE:
            raise LastingError(REPLACED)
        told = _RANGE.fullmatch(answer.headers.get("Content-Range", ""))
        if answer.status != _PARTIAL or not told:
            raise _unexpected(answer)
        if told[3] not in ("*", str(self.size)):
            raise LastingError(REPLACED)
        if (int(told[1]), int(told[2])) != (begin, end - 1):
            raise PassingError(f"asked for bytes {begin}-{end - 1}, the server sent {told[1]}-{told[2]}")
        content: bytes = await answer.content.readexactly(end - begin)
        if await answer.content.read(1):
            raise PassingError(f"asked for {end - begin} bytes, the server sent more")
        return content

    async def _whole(self, answer: aiohttp.ClientResponse, file: BinaryIO) -> None:
        if answer.status != _OK:
            raise _unexpected(answer)
        if _identity(answer) != self.identity:
            raise LastingError(REPLACED)
        length = _length(answer)
        if length < 0 and "Transfer-Encoding" not in answer.headers:
            raise LastingError("the server does not tell its size, so that its end cannot be told: copy it here")
        async for piece in answer.content.iter_chunked(_PIECE):
            file.write(piece)
        if length not in (-1, file.tell()):
            raise PassingError(f"{file.tell()} of {length} bytes came")


def _length(answer: aiohttp.ClientResponse) -> int:
    length = answer.headers.get("Content-Length", "")
    return int(length) if length.isdecimal() else -1


def _identity(answer: aiohttp.ClientResponse) -> str:
    return str(answer.headers.get("ETag") or answer.headers.get("Last-Modified") or "")


def _unexpected(answer: aiohttp.ClientResponse) -> Exception:
    if answer.status in (_OK, _PARTIAL, _OUT_OF_RANGE):
        return PassingError("the server does not say which bytes it sent")
    return LastingError(f"the server answered {answer.status}: check the URL")


def _why(error: Exception, patience: Patience) -> str:
    """Say what went wrong without what the error quotes."""
    if isinstance(error, TimeoutError):
        return f"no answer, or too slow a one, within {patience.answer_within:g} s"
    if isinstance(error, aiohttp.ClientConnectorError):
        return f"cannot connect to the server: {error.os_error.strerror or type(error).__name__}"
    if isinstance(error, aiohttp.ClientPayloadError | EOFError):
        return "the connection was lost in the middle of an answer"
    if isinstance(error, aiohttp.ServerDisconnectedError | aiohttp.ClientOSError | ConnectionError):
        return "the server closed the connection without an answer"
    return f"the server cannot be read ({type(error).__name__})"
