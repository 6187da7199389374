"""A file behind a URL as a Source: what is planned to be read is fetched ahead, a few parts at a time, and no more."""

import shutil
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from errno import ENOSPC
from pathlib import Path
from threading import Thread
from typing import BinaryIO, Final, Protocol

from syncrelay.errors import BagError
from syncrelay.recordings.bag.attempts import Patience, persist
from syncrelay.recordings.bag.sources import Span

# What is asked for at once, and what may lie between two parts of it: less than one more request costs.
_AT_ONCE: Final = 4_000_000
_GAP: Final = 32_000
# Parts that are on their way, so that a store far away is not waited for at each: 32 MB at most.
_AHEAD: Final = 8
# Chunks that overlap in time are read in turns.
_HELD: Final = 3


class Ranges(Protocol):
    """A file that is read by ranges, as it was when it was opened. All raise PassingError or LastingError.

    `identity` tells it from another that is behind the URL later: an ETag, a generation, or when it was changed.
    """

    size: int
    identity: str
    has_ranges: bool

    def fetch(self, begin: int, end: int) -> bytes:
        """Return the bytes from one place up to another, all of them; called from several threads."""
        ...

    def fetch_all(self, file: BinaryIO) -> None:
        """Write the whole into a file from its begin on, where there are no ranges."""
        ...


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
        self._windows: list[Span] = []
        self._by_place: list[tuple[int, int]] = []
        self._coming: dict[int, Future[bytes]] = {}

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
        self._windows = list(_windows(spans, self.size))
        self._by_place = sorted((begin, number) for number, (begin, _) in enumerate(self._windows))
        self._coming.clear()

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

    def close(self) -> None:
        """See Source: connections are those of a file system that others use too."""
        self._held.clear()
        self.expect(())

    def _copy_to(self, path: Path) -> None:
        with path.open("wb") as file:
            if not self.has_ranges:
                persist(self.name, lambda: self._ranges.fetch_all(file), self._patience)
                return
            self.seek(0)
            self.expect([(0, self.size)])
            while piece := self.read(_AT_ONCE):
                file.write(piece)

    def _holding(self, asked: int) -> tuple[int, bytes]:
        """Return bytes that hold the present place, and where they begin."""
        place = self._place
        for each in self._held:
            if each[0] <= place < each[0] + len(each[1]):
                return each
        at = bisect_right(self._by_place, (place, len(self._windows))) - 1
        begin, number = self._by_place[at] if at >= 0 else (0, -1)
        if number >= 0 and place < begin + self._windows[number][1]:
            self._held.append((begin, self._planned(number)))
        else:
            self._held.append((place, self._fetch(place, min(asked, place + _AT_ONCE))))
        return self._held[-1]

    def _planned(self, number: int) -> bytes:
        """Return what is in a window, and have those fetched that come next."""
        for each in range(number, min(number + _AHEAD, len(self._windows))):
            if each not in self._coming:
                begin, size = self._windows[each]
                self._coming[each] = self._begun(begin, begin + size)
        coming = self._coming.pop(number)
        for passed in [each for each in self._coming if each < number]:
            del self._coming[passed]
        return coming.result()

    def _begun(self, begin: int, end: int) -> Future[bytes]:
        """Fetch in a thread that nobody waits for when this process ends: a server may take its time."""
        coming: Future[bytes] = Future()

        def fetch() -> None:
            try:
                coming.set_result(self._fetch(begin, end))
            except BaseException as error:  # noqa: BLE001  told where it is read
                coming.set_exception(error)

        Thread(target=fetch, daemon=True).start()
        return coming

    def _fetch(self, begin: int, end: int) -> bytes:
        return persist(self.name, lambda: self._ranges.fetch(begin, end), self._patience)


def _windows(spans: Sequence[Span], size: int) -> Iterator[Span]:
    """Yield what to ask for, none larger than is asked for at once, in the order in which it is read."""
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
