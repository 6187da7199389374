"""Recordings behind URLs: s3://, gs://, https:// and http://, found by prefix and pattern and read by ranges.

What reaches them is optional (the extra `fleet`) and is imported here when a URL is opened.
"""

import re
import shutil
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Sequence
from errno import ENOSPC
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final, Protocol, TypeVar

from syncrelay.bag.attempts import Patience, persist, redacted, scheme_of
from syncrelay.bag.names import METADATA, is_recording_name, natural
from syncrelay.bag.sources import Span
from syncrelay.errors import BagError, StorageError

if TYPE_CHECKING:
    from syncrelay.bag.object_store import ObjectStore

_Done = TypeVar("_Done")
_STORES: Final = ("s3", "gs")
_SERVERS: Final = ("http", "https")
_PATTERN: Final = re.compile(r"[*?\[]")
# What is asked for at once, and what may lie between two parts of it: less than one more request costs.
_AT_ONCE: Final = 4_000_000
_GAP: Final = 32_000
# Chunks that overlap in time are read in turns.
_HELD: Final = 3
PATIENCE: Final = Patience()
# The libraries of stores try again by themselves.
_STORE_PATIENCE: Final = Patience(attempts=3)


class Ranges(Protocol):
    """A file that is read by ranges, as it was when it was opened. All raise PassingError or LastingError.

    `identity` tells it from another that is behind the URL later: an ETag, a generation, or when it was changed.
    """

    size: int
    identity: str
    has_ranges: bool

    def fetch(self, begin: int, end: int) -> bytes:
        """Return the bytes from one place up to another: all of them."""
        ...

    def fetch_all(self, file: BinaryIO) -> None:
        """Write the whole into a file from its begin on, where there are no ranges."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


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


def open_url(url: str, patience: Patience | None = None) -> "RemoteFile":
    """Open a file behind a URL; raises StorageError where it cannot be reached, and names the extra if that is it."""
    scheme = scheme_of(url)
    try:
        if scheme in _STORES:
            from syncrelay.bag.object_store import StoredObject  # noqa: PLC0415  optional

            store, asked = _store(url), patience or _STORE_PATIENCE
            return RemoteFile(persist(redacted(url), lambda: StoredObject(store, url), asked), redacted(url), asked)
        if scheme in _SERVERS:
            from syncrelay.bag.http_file import HttpFile  # noqa: PLC0415  optional

            asked = patience or PATIENCE
            return RemoteFile(persist(redacted(url), lambda: HttpFile(url, asked), asked), redacted(url), asked)
    except ImportError as error:
        raise _missing(url, error) from error
    raise BagError(f"{redacted(url)}: {scheme}:// cannot be read, expected s3://, gs://, https:// or http://")


class RemoteFile:
    """A file behind a URL, open for reading; see Source. What is read is what was there when it was opened.

    Each read gives all that was asked for, or raises StorageError.
    """

    is_near = False

    def __init__(self, ranges: Ranges, name: str, patience: Patience) -> None:
        """Read a file that messages call `name`, which holds no secret."""
        self.name = name
        self.size = ranges.size
        self.identity = ranges.identity
        self.has_ranges = ranges.has_ranges
        self._ranges = ranges
        self._patience = patience
        self._place = 0
        self._held: deque[tuple[int, bytes]] = deque(maxlen=_HELD)
        self._planned: list[Span] = []

    def seek(self, place: int, /) -> int:
        """See Source."""
        self._place = place
        return place

    def read(self, size: int, /) -> bytes:
        """See Source."""
        end = min(self._place + size, self.size)
        parts = []
        while self._place < end:
            begin, held = self._holding(end)
            part = held[self._place - begin : end - begin]
            self._place += len(part)
            parts.append(part)
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def expect(self, spans: Sequence[Span]) -> None:
        """See Source: what stands close together is asked for at once."""
        planned: list[Span] = []
        for begin, size in sorted(spans):
            last, length = planned[-1] if planned else (begin, -1)
            if length >= 0 and begin - last - length <= _GAP and begin + size - last <= _AT_ONCE:
                planned[-1] = last, max(length, begin + size - last)
            else:
                planned.append((begin, size))
        self._planned = planned

    def download(self, path: Path) -> None:
        """Write the whole into a file; raises StorageError, and BagError where there is no space for it."""
        try:
            free = shutil.disk_usage(path.parent).free
            if self.size <= free:
                self._copy_to(path)
                return
            why = f"it has {self.size:,} bytes, and {free:,} are free"
        except OSError as error:
            why = "no space is left" if error.errno == ENOSPC else f"{error.strerror}"
        raise BagError(f"{self.name}: cannot be copied to {path.parent}: {why}, set TMPDIR to another folder")

    def _copy_to(self, path: Path) -> None:
        with path.open("wb") as file:
            if not self.has_ranges:
                persist(self.name, lambda: self._ranges.fetch_all(file), self._patience)
                return
            self.seek(0)
            self.expect([(0, self.size)])
            while piece := self.read(_AT_ONCE):
                file.write(piece)

    def close(self) -> None:
        """See Source."""
        self._held.clear()
        self._ranges.close()

    def _holding(self, asked: int) -> tuple[int, bytes]:
        """Return bytes that hold the present place, and where they begin."""
        for each in self._held:
            if each[0] <= self._place < each[0] + len(each[1]):
                return each
        self._held.append((self._place, self._fetch(self._place, asked)))
        return self._held[-1]

    def _fetch(self, begin: int, asked: int) -> bytes:
        """Return what is at a place, up to the end of what is planned there or else of what was asked for."""
        at = bisect_right(self._planned, begin, key=lambda span: span[0]) - 1
        planned = sum(self._planned[at]) if at >= 0 else 0
        end = min(planned if planned > begin else asked, begin + _AT_ONCE, self.size)
        return persist(self.name, lambda: self._ranges.fetch(begin, end), self._patience)


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
        from syncrelay.bag.object_store import ObjectStore  # noqa: PLC0415  optional

        return _ask(word, lambda: ObjectStore(scheme_of(word)))
    except ImportError as error:
        raise _missing(word, error) from error


def _missing(word: str, error: ImportError) -> StorageError:
    return StorageError(
        f"{redacted(word)}: {error.name or 'a library'} is not installed, which reads {scheme_of(word)}:// URLs: "
        "pip install 'syncrelay[fleet]'"
    )


def _name(url: str) -> str:
    return url.rpartition("/")[2]


def _folder(url: str) -> str:
    return url.rpartition("/")[0]
