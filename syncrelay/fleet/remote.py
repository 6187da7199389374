"""Recordings that are no files of this machine: what tells a URL, and whether what it names is still the same."""

import re
from typing import Any, Final

from syncrelay.errors import BagError, SyncRelayError

_URL: Final = re.compile(r"[a-z][a-z0-9+.-]+://.", re.IGNORECASE)


def is_url(word: str) -> bool:
    """Tell whether a word is a URL, which is passed on as it is."""
    return _URL.match(word) is not None


def find(word: str) -> list[str]:
    """Return the recordings that a URL names."""
    return [word]


def content_of_url(url: str) -> tuple[str, int]:
    """Return what changes when the content of a URL does, by its ETag and size, and its size in bytes.

    Raises BagError where it cannot be read, or has no ETag, without which a change could be missed.
    """
    try:
        import fsspec  # noqa: PLC0415  of the extra `fleet`
    except ImportError as error:
        raise SyncRelayError(
            f"{url}: fsspec is needed to read URLs and is not installed: pip install 'syncrelay[fleet]'"
        ) from error
    try:
        system, path = fsspec.url_to_fs(url)
        about: dict[str, Any] = system.info(path)
    except (OSError, ValueError, ImportError) as error:
        raise BagError(f"{url}: cannot be read: {error}") from error
    etag = next((str(about[key]) for key in ("ETag", "etag", "md5Hash", "content_md5") if about.get(key)), None)
    size = about.get("size")
    if etag is None or not isinstance(size, int):
        raise BagError(f"{url}: its server tells no ETag and size, by which a change of it would be seen: download it")
    return f"etag:{etag.strip(chr(34))}:{size}", size
