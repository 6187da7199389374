"""Objects of S3 and Google Cloud Storage: listed, and read by ranges that are of the one version that was opened."""

from collections.abc import Callable
from typing import Any, BinaryIO, Final, TypeVar

import fsspec

from syncrelay.recordings.bag.attempts import REPLACED, LastingError, PassingError

_Done = TypeVar("_Done")
_DENIED: Final = "access denied: check the credentials (docs/howto/storage.md)"
_NO_CREDENTIALS: Final = ("NoCredentialsError", "PartialCredentialsError", "ProfileNotFound", "DefaultCredentialsError")
_DENIALS: Final = ("Forbidden", "Anonymous caller", "Invalid Credentials")
_UNAUTHORIZED, _FORBIDDEN, _NOT_FOUND = 401, 403, 404


class ObjectStore:
    """All that one scheme leads to, with the credentials and endpoints of its library's own configuration."""

    def __init__(self, scheme: str) -> None:
        """Set up; raises ImportError where the library is missing, PassingError or LastingError."""
        self._scheme = scheme
        # A listing that is kept would hide that a file was replaced.
        self.files = _tried(lambda: fsspec.filesystem(scheme, use_listings_cache=False))
        if scheme == "s3":
            # botocore tries again too, as AWS_MAX_ATTEMPTS says: three loops in one another would never end.
            self.files.retries = 1

    def kind(self, url: str) -> str:
        """Return whether a URL is a `file` or a `directory`; raises PassingError or LastingError where it is none."""
        return str(_tried(lambda: self.files.info(url))["type"])

    def matching(self, pattern: str) -> dict[str, str]:
        """Return the URLs that match a pattern, and the kind of each."""
        found = _tried(lambda: self.files.glob(pattern, detail=True))
        return {self._url(path): str(each["type"]) for path, each in found.items()}

    def below(self, folder: str) -> list[str]:
        """Return the URLs of all files below a folder, at any depth."""
        return [self._url(path) for path in _tried(lambda: self.files.find(folder))]

    def _url(self, path: str) -> str:
        return f"{self._scheme}://{path}"


class StoredObject:
    """An object; see Ranges."""

    has_ranges = True

    def __init__(self, store: ObjectStore, url: str) -> None:
        """Find an object; raises PassingError or LastingError."""
        self._read, about = _tried(lambda: _opened(store, url))
        self.size = int(about["size"])
        self.identity = str(about.get("ETag") or about.get("generation") or about.get("etag") or about.get("mtime"))

    def fetch(self, begin: int, end: int) -> bytes:
        """See Ranges."""
        try:
            content = _tried(lambda: self._read(begin, end))
        except _MissingError:
            raise LastingError(REPLACED) from None
        if len(content) != end - begin:
            raise PassingError(f"asked for {end - begin} bytes, {len(content)} came")
        return content

    def fetch_all(self, file: BinaryIO) -> None:
        """See Ranges: there are ranges, so nobody asks."""
        raise NotImplementedError


class _MissingError(LastingError):
    """There is no such object."""


def _opened(store: ObjectStore, url: str) -> tuple[Callable[[int, int], bytes], dict[str, Any]]:
    """Return what reads from a place to another of an object's present version, and what its store tells about it."""
    about = store.files.info(url)
    if about["type"] != "file":
        raise LastingError("is a folder, expected a file")
    generation = about.get("generation")
    if generation is not None:
        return lambda begin, end: bytes(store.files.cat_file(url, begin, end, generation=generation)), about
    # Each of its requests asks for the ETag that it found.
    file = store.files.open(url, "rb", cache_type="none")
    return file.cache.fetcher, dict(file.details)


def _tried(work: Callable[[], _Done]) -> _Done:
    """Return what work gives; raises PassingError or LastingError for whatever the libraries raise."""
    try:
        return work()
    except (PassingError, LastingError, ImportError):
        raise
    except FileNotFoundError as error:
        raise _MissingError("no such object, or bucket: check the URL") from error
    # Three libraries and what they are made of have no error in common.
    except Exception as error:
        raise _told(error) from error


def _told(error: Exception) -> Exception:
    kind, code = type(error).__name__, getattr(error, "code", None)
    if kind in _NO_CREDENTIALS:
        return LastingError(f"no credentials were found ({kind}): docs/howto/storage.md says where they are looked for")
    if isinstance(error, PermissionError) or code in (_UNAUTHORIZED, _FORBIDDEN) or str(error).startswith(_DENIALS):
        return LastingError(_DENIED)
    if code == _NOT_FOUND:
        return _MissingError("no such object, or bucket: check the URL")
    if kind == "FileExpired":
        return LastingError(REPLACED)
    why = error.strerror if isinstance(error, OSError) else None
    return PassingError(f"the store cannot be read: {why or kind}")
