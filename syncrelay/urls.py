"""What is behind a URL, by fsspec: which library is asked, its names without secrets, its errors in a sentence."""

import re
import time
from collections.abc import Callable
from typing import Any, Final, TypeVar
from urllib.parse import urlsplit

from syncrelay.errors import NO_SPACE, StorageError, SyncRelayError, UnavailableError
from syncrelay.recording_files import scheme_of

SERVERS: Final = ("http", "https")
"""Schemes of servers, which list no folders and take no files."""

LOCAL: Final = ("file", "local")
"""Schemes of files of this machine."""

# Schemes whose libraries the extra `fleet` brings.
_BROUGHT: Final = (*SERVERS, "s3", "s3a", "gs", "gcs")

REPLACED: Final = "was replaced or removed while it was being read: read it again"
"""What is wrong with a file that is not the one that was opened."""

ATTEMPTS: Final = 5
# Each wait is twice the one before.
_FIRST_WAIT: Final = 0.3
_CONNECT_WITHIN: Final = 15.0
_BYTES_WITHIN: Final = 60.0
# Four megabytes, which is all that is asked for at once, at 50 kB a second.
_ANSWER_WITHIN: Final = 140.0
_Done = TypeVar("_Done")
# A name and a password before the host; a password may hold a slash that should have been %2F.
_LOGIN: Final = re.compile(r"[^/?#]*@|[^/?#:\[]*:(?!\d*(?:[/?#]|$))[^?#]*@")
_NEXT_LINK: Final = re.compile(r"::(?=[a-z][a-z0-9+.-]*://)", re.IGNORECASE)
_DENIED: Final = "access denied: check the credentials (docs/howto/storage.md), and whether a signed URL has expired"
_DENIALS: Final = ("Forbidden", "Anonymous caller", "Invalid Credentials")
_NO_CREDENTIALS: Final = (
    "no credentials were found (docs/howto/storage.md says where they are looked for): check the environment"
)
_NO_SERVER: Final = "is not the URL of a server: check it"
_GONE: Final = "no such file, folder or bucket: check the URL"
_STATUSES: Final = {401: _DENIED, 403: _DENIED, 404: _GONE, 410: _GONE, 412: REPLACED}
_PASSING: Final = (408, 421, 425, 429)
_SERVER_ERRORS: Final = 500
# By the names of classes of botocore, google.auth, s3fs and aiohttp, which are imported only by those who use them.
_LASTING_ERRORS: Final = {
    "NoCredentialsError": _NO_CREDENTIALS,
    "PartialCredentialsError": _NO_CREDENTIALS,
    "ProfileNotFound": _NO_CREDENTIALS,
    "DefaultCredentialsError": _NO_CREDENTIALS,
    "PermissionError": _DENIED,
    "FileNotFoundError": _GONE,
    "NoSuchBucket": _GONE,
    "FileExpired": REPLACED,
    "InvalidURL": _NO_SERVER,
    "TooManyRedirects": "the server redirects too often",
    "ClientSSLError": "the server's certificate is not trusted here: check the URL, and SSL_CERT_FILE",
}
_PASSING_ERRORS: Final = {
    "TimeoutError": "the server did not answer in time",
    "ClientConnectorError": "cannot connect to the server",
    "ClientPayloadError": "the connection was lost in the middle of an answer",
    "ServerDisconnectedError": "the server closed the connection without an answer",
    "ClientOSError": "the server closed the connection without an answer",
    "ValueError": "the server did not send the bytes that were asked for",
}


class IncompleteError(Exception):
    """An answer is not what was asked for; its text says what came, without the URL."""


def redacted(word: str) -> str:
    """Return a URL without a name and password, and without the query that may sign it; any other word as it is."""
    return "::".join(map(_link_redacted, _NEXT_LINK.split(word)))


def _link_redacted(word: str) -> str:
    scheme = scheme_of(word)
    if not scheme:
        return word
    rest = word[len(scheme) + 3 :]
    rest = rest[found.end() :] if (found := _LOGIN.match(rest)) else rest
    if scheme in SERVERS:
        plain = re.split(r"[?#]", rest, maxsplit=1)[0]
        rest = plain if plain == rest else f"{plain}?..."
    return f"{scheme}://{rest}"


def file_system(url: str) -> tuple[Any, str]:
    """Return fsspec's file system for a URL, and the path in it.

    Credentials and endpoints are those of its library's own configuration. Raises UnavailableError where a library is
    missing, and StorageError for a scheme that none knows and for a chain of URLs.
    """
    if "::" in url:
        raise StorageError(
            f"{redacted(url)}: `::` in a URL is not supported, because fsspec takes it for a chain of URLs: name the"
            " file's own URL, or copy it here"
        )
    scheme = scheme_of(url)
    if scheme in SERVERS and not _has_valid_port(url):
        raise StorageError(f"{redacted(url)}: {_NO_SERVER}")
    # fsspec knows schemes in lower case alone.
    url = scheme + url[len(scheme) :]
    try:
        import fsspec  # noqa: PLC0415  optional

        found: tuple[Any, str] = tried(url, lambda: fsspec.url_to_fs(url, **_options(url)), attempts=1)
    except ImportError as error:
        extra = "pip install 'syncrelay[fleet]' (in a clone: pip install '.[fleet]')"
        # Of other schemes, fsspec says which library to install.
        advice = extra if scheme in _BROUGHT or error.name == "fsspec" else error
        raise UnavailableError(
            f"{redacted(url)}: what reads and writes {scheme}:// URLs is not installed: {advice}"
        ) from error
    if scheme == "s3":
        # botocore tries again too, as AWS_MAX_ATTEMPTS says: three loops in one another would hardly end.
        found[0].retries = 1
    return found


def tried(url: str, work: Callable[[], _Done], *, attempts: int = ATTEMPTS) -> _Done:
    """Return what `work` gives, tried again while only what may pass is wrong; raises StorageError otherwise.

    Errors of ours, missing libraries and a full disk are raised as they are.
    """
    wait = _FIRST_WAIT
    for left in reversed(range(attempts)):
        try:
            return work()
        except (SyncRelayError, ImportError):
            raise
        except Exception as error:  # libraries of many authors have no error in common
            if isinstance(error, OSError) and error.errno in NO_SPACE:
                raise
            why, may_pass = _reason(error, scheme_of(url))
        if not may_pass:
            break
        if left:
            time.sleep(wait)
            wait *= 2
        elif attempts > 1:
            why += f" ({attempts} attempts): try again later"
    # Without what was caught: errors of the libraries quote the URL with its secrets, and tracebacks travel.
    raise StorageError(f"{redacted(url)}: {why}") from None


def _has_valid_port(url: str) -> bool:
    try:
        urlsplit(url).port  # noqa: B018  raises
    except ValueError:
        return False
    return True


def _options(url: str) -> dict[str, Any]:
    # A listing that is kept would hide that a file was replaced.
    options: dict[str, Any] = {"use_listings_cache": False}
    if scheme_of(url) in SERVERS:
        import aiohttp  # noqa: PLC0415  optional
        from fsspec.config import conf  # noqa: PLC0415  optional

        limits = aiohttp.ClientTimeout(total=_ANSWER_WITHIN, sock_connect=_CONNECT_WITHIN, sock_read=_BYTES_WITHIN)
        # What is configured for fsspec stands; without, proxies and .netrc are as for other programs.
        configured = conf.get("https", {}).get("client_kwargs", {})
        options["client_kwargs"] = {"trust_env": True, "timeout": limits, **configured}
        # What is percent-encoded was signed so.
        options["encoded"] = "%" in url
    return options


def _reason(error: Exception, scheme: str) -> tuple[str, bool]:
    """Say what is wrong without what the error quotes, and tell whether it may pass."""
    if isinstance(error, IncompleteError):
        return str(error), True
    if isinstance(error, ValueError) and str(error).startswith("Protocol not known"):
        return f"no library reads {scheme}:// URLs: expected s3://, gs://, https:// or another that fsspec knows", False
    # fsspec's HTTP says of whatever goes wrong that there is no such file.
    if isinstance(error, FileNotFoundError) and isinstance(error.__cause__, Exception):
        error = error.__cause__
    kinds = [kind.__name__ for kind in type(error).__mro__]
    # Its status is 0.
    status = None if "TooManyRedirects" in kinds else getattr(error, "status", None) or getattr(error, "code", None)
    if str(error).startswith(_DENIALS):
        return _DENIED, False
    if isinstance(status, int):
        may_pass = status in _PASSING or status >= _SERVER_ERRORS
        return _STATUSES.get(status, f"the server answered {status}"), may_pass
    for sentences, may_pass in ((_LASTING_ERRORS, False), (_PASSING_ERRORS, True)):
        for kind in kinds:
            if kind in sentences:
                return sentences[kind], may_pass
    why = error.strerror if isinstance(error, OSError) else None
    return f"the store cannot be reached: {why or kinds[0]}", True
