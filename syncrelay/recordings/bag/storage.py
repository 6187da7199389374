"""Recordings behind URLs: s3://, gs://, https:// and http://, found by prefix and pattern and read by ranges.

What reaches them is optional (the extra `fleet`) and is imported here when a URL is opened.
"""

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, TypeVar

from syncrelay.errors import BagError, StorageError
from syncrelay.recording_files import METADATA, is_recording_name, scheme_of
from syncrelay.recordings.bag.attempts import Patience, persist, redacted
from syncrelay.recordings.bag.names import natural
from syncrelay.recordings.bag.remote_file import RemoteFile

if TYPE_CHECKING:
    from syncrelay.recordings.bag.object_store import ObjectStore

_Done = TypeVar("_Done")
_STORES: Final = ("s3", "gs")
_SERVERS: Final = ("http", "https")
_PATTERN: Final = re.compile(r"[*?\[]")
PATIENCE: Final = Patience()
# The libraries of stores try again by themselves.
_STORE_PATIENCE: Final = Patience(attempts=3)


def is_url(word: str) -> bool:
    """Tell whether a word means something behind a URL, and no file of this machine."""
    return bool(scheme_of(word))


def find(word: str) -> list[str]:
    """Return the recordings that a word means, in the order of their names; any word but a URL means itself.

    In object storage a pattern means what matches it, a folder all recordings below it, of which a folder of rosbag2
    is one. A server has no listing: its URL means itself. Raises BagError where there is none.
    """
    if scheme_of(word) not in _STORES:
        return [word]
    store = _store(word)
    kinds = _kinds(store, word)
    found = {url for url, kind in kinds.items() if kind == "file"}
    below = {url for folder in kinds.keys() - found for url in _below(store, folder)}
    folders = {_folder(url) for url in found | below if _name(url) == METADATA}
    known = {url for url in below if is_recording_name(_name(url))}
    known |= {url for url in found if _name(url) != METADATA and (is_recording_name(_name(url)) or url == word)}
    recordings = {_folder(url) if _folder(url) in folders and url in below else url for url in known}
    recordings |= {_folder(url) for url in found if _name(url) == METADATA}
    if not recordings:
        raise BagError(f"{redacted(word)}: holds no recording: check the URL")
    return sorted(recordings, key=natural)


def files_of(word: str) -> list[str]:
    """Return the files of one recording as a local path means them: a file, or all that are in a folder."""
    if scheme_of(word) not in _STORES:
        return [word]
    store = _store(word)
    files: list[str] = []
    for url, kind in _kinds(store, word).items():
        folder = _folder(url) if _name(url) == METADATA else url
        if kind == "file" and folder == url:
            files.append(url)
            continue
        files += [each for each in _below(store, folder) if _folder(each) == folder and is_recording_name(_name(each))]
    if not files:
        raise BagError(f"{redacted(word)}: holds no recording: name a file, or a folder that has one in it")
    return sorted(files, key=natural)


def metadata_of(word: str) -> str | None:
    """Return the URL of what rosbag2 says of the files of a folder; None where a word means no folder that has it."""
    if scheme_of(word) not in _STORES or _PATTERN.search(word):
        return None
    place = word.rstrip("/").removesuffix(f"/{METADATA}")
    url = f"{place}/{METADATA}"
    return url if url in _below(_store(word), place) else None


def open_url(url: str, patience: Patience | None = None) -> RemoteFile:
    """Open a file behind a URL; raises StorageError where it cannot be reached, and names the extra if that is it."""
    scheme = scheme_of(url)
    try:
        if scheme in _STORES:
            from syncrelay.recordings.bag.object_store import StoredObject  # noqa: PLC0415  optional

            store, asked = _store(url), patience or _STORE_PATIENCE
            return RemoteFile(persist(redacted(url), lambda: StoredObject(store, url), asked), redacted(url), asked)
        if scheme in _SERVERS:
            from syncrelay.recordings.bag.http_file import HttpFile  # noqa: PLC0415  optional

            asked = patience or PATIENCE
            return RemoteFile(persist(redacted(url), lambda: HttpFile(url, asked), asked), redacted(url), asked)
    except ImportError as error:
        raise _missing(url, error) from error
    raise BagError(f"{redacted(url)}: {scheme}:// cannot be read, expected s3://, gs://, https:// or http://")


def _kinds(store: "ObjectStore", word: str) -> dict[str, str]:
    """Return the files and folders that a word means, and which of both each is."""
    word = word.rstrip("/")
    if not _PATTERN.search(word):
        return {word: _ask(word, lambda: store.kind(word))}
    return _ask(word, lambda: store.matching(word))


def _below(store: "ObjectStore", folder: str) -> list[str]:
    return _ask(folder, lambda: store.below(folder))


def _ask(word: str, work: Callable[[], _Done]) -> _Done:
    return persist(redacted(word), work, _STORE_PATIENCE)


def _store(word: str) -> "ObjectStore":
    try:
        from syncrelay.recordings.bag.object_store import ObjectStore  # noqa: PLC0415  optional

        return _ask(word, lambda: ObjectStore(scheme_of(word)))
    except ImportError as error:
        raise _missing(word, error) from error


def _missing(word: str, error: ImportError) -> StorageError:
    return StorageError(
        f"{redacted(word)}: {error.name or 'a library'} is not installed, which reads {scheme_of(word)}:// URLs: "
        "pip install 'FOLDER-OF-SYNCRELAY[fleet]'"
    )


def _name(url: str) -> str:
    return url.rpartition("/")[2]


def _folder(url: str) -> str:
    return url.rpartition("/")[0]
