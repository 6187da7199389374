"""Where the bytes of a recording come from, as its reader sees it: a file of this machine, or one behind a URL."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, TypeAlias

Span: TypeAlias = tuple[int, int]
"""Where bytes begin, and how many they are."""


class NoIndexError(Exception):
    """A file that is not to be gone through twice has no index that can be trusted."""


class Source(Protocol):
    """A file that is open for reading, at any place of it."""

    size: int
    is_near: bool
    """Whether going through all of it costs little more than reading what is wanted."""

    def seek(self, place: int, /) -> object:
        """Have the next bytes read from a place on."""
        ...

    def read(self, size: int, /) -> bytes:
        """Return so many of the next bytes, and fewer only at the end of the file."""
        ...

    def expect(self, spans: Sequence[Span]) -> None:
        """Take in what is read next, in this order: who fetches it may fetch no more than that, and no less at once."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class LocalFile:
    """A file of this machine; see Source."""

    is_near = True

    def __init__(self, path: Path) -> None:
        """Open a file."""
        self._file = path.open("rb")
        self.size = os.fstat(self._file.fileno()).st_size
        self.seek = self._file.seek
        self.read = self._file.read
        self.close = self._file.close

    def expect(self, spans: Sequence[Span]) -> None:
        """See Source: the system reads ahead by itself."""
