"""A file behind a URL as a Source: what is announced by `expect` is fetched ahead, a few parts at a time."""

import shutil
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from pathlib import Path
from threading import Thread
from typing import Any, Final, TypeAlias

from syncrelay.errors import NO_SPACE, BagError, StorageError
from syncrelay.recording_files import scheme_of
from syncrelay.recordings.bag.sources import Span
from syncrelay.urls import REPLACED, SERVERS, IncompleteError, file_system, redacted, tried

Fetch: TypeAlias = Callable[[int, int], bytes]
"""Returns the bytes from one place up to another; called from several threads."""

# Why not one of fsspec's caches: they fetch whole blocks, one after another. Of a recording of 10 MB with two small
# topics they fetch all of it instead of 55 kB.
_AT_ONCE: Final = 4_000_000
# Bytes between two spans that are fetched as well, because one more request would cost more.
_GAP: Final = 32_000
# Requests at a time, because a distant store takes long to answer each: 32 MB in memory at most.
_AHEAD: Final = 8
# Windows that are kept, because chunks that overlap in time are read in turns.
_HELD: Final = 3
# At its begin a file could be read without ranges too.
_PROBED: Final = (1, 2)
_IDENTITIES: Final = ("ETag", "generation", "etag", "Last-Modified", "LastModified", "mtime")


class RemoteFile:
    """A file behind a URL, open for reading; see Source. It reads the version that was there when it was opened.

    Each read returns all the bytes that were asked for, or raises StorageError.
    """

    is_near = False

    def __init__(self, url: str) -> None:
        """Look up the file; raises StorageError if it cannot be reached, UnavailableError if a library is missing."""
        self._files, self._path = file_system(url)
        self._url = url
        self.name = redacted(url)
        """The URL without secrets, for messages."""
        self._about = self._look()
        self.identity = _identity(self._about)
        """Changes when the file is replaced; empty if its server sends nothing of the kind."""
        if self._about.get("size") is None:
            raise StorageError(f"{self.name}: the server does not tell its size, so its end is unknown: copy it here")
        self.size = int(self._about["size"])
        self._fetch_range = _fetcher(self._files, self._path, self._about, url)
        self.has_ranges = scheme_of(url) not in SERVERS or self._sends_ranges()
        self._held: deque[tuple[int, bytes]] = deque(maxlen=_HELD)
        self._windows: list[Span] = []
        self._by_place: list[tuple[int, int]] = []
        self._coming: dict[int, Future[bytes]] = {}

    def read(self, place: int, size: int) -> bytes:
        """See Source."""
        end = min(place + size, self.size)
        parts = []
        while place < end:
            begin, held = self._holding(place, end)
            part = held[place - begin : end - begin]
            place += len(part)
            parts.append(part)
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def expect(self, spans: Sequence[Span]) -> None:
        """See Source. Spans that are close together become one request."""
        self._windows = list(_windows(spans, self.size))
        self._by_place = sorted((begin, number) for number, (begin, _) in enumerate(self._windows))
        self._coming = {}

    def download(self, path: Path) -> None:
        """Write the whole file to a path; raises StorageError, and BagError if there is no space for it."""
        try:
            free = shutil.disk_usage(path.parent).free
            if self.size <= free:
                self._copy_to(path)
                return
            why = f"it has {self.size:,} bytes, and {free:,} are free"
        except OSError as error:
            why = "no space is left" if error.errno in NO_SPACE else f"{error.strerror}"
        raise BagError(f"{self.name}: cannot be copied to {path.parent}: {why}, set TMPDIR to another folder")

    def close(self) -> None:
        """See Source. The connections belong to a file system that others use too."""

    def _look(self) -> Mapping[str, Any]:
        """Return what the store says about the file now."""
        about: Mapping[str, Any] = tried(self._url, lambda: self._files.info(self._path))
        if about["type"] != "file":
            raise StorageError(f"{self.name}: is a folder, expected a file")
        return about

    def _sends_ranges(self) -> bool:
        if self._about.get("partial") is False:
            return False

        def probe() -> bool:
            try:
                return self.size < len(_PROBED) or bool(self._fetch_once(*_PROBED))
            except ValueError:
                # fsspec's, for an answer that is the whole file.
                return False

        return tried(self._url, probe)

    def _copy_to(self, path: Path) -> None:
        if not self.has_ranges:
            tried(self._url, lambda: self._files.get_file(self._path, str(path)))
            if path.stat().st_size != self.size:
                raise StorageError(f"{self.name}: {path.stat().st_size:,} of {self.size:,} bytes came")
            return
        with path.open("wb") as file:
            self.expect([(0, self.size)])
            for place, size in self._windows:
                file.write(self.read(place, size))

    def _holding(self, place: int, asked: int) -> tuple[int, bytes]:
        """Return bytes that contain an offset, and where they begin."""
        for each in self._held:
            if each[0] <= place < each[0] + len(each[1]):
                return each
        at = bisect_right(self._by_place, (place, len(self._windows)))
        if at:
            begin, number = self._by_place[at - 1]
            if place < begin + self._windows[number][1]:
                self._held.append((begin, self._planned(number)))
                return self._held[-1]
        self._held.append((place, self._fetch(place, min(asked, place + _AT_ONCE))))
        return self._held[-1]

    def _planned(self, number: int) -> bytes:
        """Return the bytes of a window, and start to fetch the next ones."""
        for each in range(number, min(number + _AHEAD, len(self._windows))):
            if each not in self._coming:
                begin, size = self._windows[each]
                self._coming[each] = self._begun(begin, begin + size)
        coming = self._coming.pop(number)
        for passed in [each for each in self._coming if each < number]:
            del self._coming[passed]
        return coming.result()

    def _begun(self, begin: int, end: int) -> Future[bytes]:
        """Fetch in a daemon thread: the process can end while a slow server still answers."""
        coming: Future[bytes] = Future()

        def fetch() -> None:
            try:
                coming.set_result(self._fetch(begin, end))
            except BaseException as error:  # noqa: BLE001  raised where it is read
                coming.set_exception(error)

        Thread(target=fetch, daemon=True).start()
        return coming

    def _fetch(self, begin: int, end: int) -> bytes:
        return tried(self._url, lambda: self._fetch_once(begin, end))

    def _fetch_once(self, begin: int, end: int) -> bytes:
        content = self._fetch_range(begin, end)
        if len(content) != end - begin:
            about = self._look()
            if (_identity(about), about.get("size")) != (self.identity, self.size):
                raise StorageError(f"{self.name}: {REPLACED}")
            raise IncompleteError(f"asked for {end - begin} bytes, {len(content)} came")
        return content


def _fetcher(files: Any, path: str, about: Mapping[str, Any], url: str) -> Fetch:
    """Return what fetches ranges of the opened version of a file, as far as its store knows versions."""
    if "generation" in about:
        return lambda begin, end: bytes(files.cat_file(path, start=begin, end=end, generation=about["generation"]))
    pinned: dict[str, Any] = {}
    if scheme_of(url) in SERVERS:
        # Ranges are those of the file and not of a compressed form of it.
        headers = {"Accept-Encoding": "identity"}
        if about.get("ETag", "W/").startswith("W/"):
            headers |= {"If-Unmodified-Since": about["Last-Modified"]} if "Last-Modified" in about else {}
        else:
            headers["If-Match"] = about["ETag"]
        pinned = {"headers": headers, "size": about["size"]}
    file = tried(url, lambda: files.open(path, "rb", cache_type="none", **pinned))
    # Files of S3 and HTTP fetch ranges by their cache. Other file systems have cat_file.
    cache = getattr(file, "cache", None)
    if cache is None:
        return lambda begin, end: bytes(files.cat_file(path, start=begin, end=end))
    fetch: Fetch = cache.fetcher
    return fetch


def _identity(about: Mapping[str, Any]) -> str:
    return next((str(about[name]) for name in _IDENTITIES if about.get(name)), "")


def _windows(spans: Sequence[Span], size: int) -> Iterator[Span]:
    """Yield the requests for spans, in the order of reading, none larger than _AT_ONCE."""
    begin = end = 0
    for place, length in spans:
        if end and place >= begin and place - end <= _GAP and place + length - begin <= _AT_ONCE:
            end = max(end, place + length)
            continue
        yield from _split(begin, min(end, size))
        begin, end = place, place + length
    yield from _split(begin, min(end, size))


def _split(begin: int, end: int) -> Iterator[Span]:
    for place in range(begin, end, _AT_ONCE):
        yield place, min(_AT_ONCE, end - place)
