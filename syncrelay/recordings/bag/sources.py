"""What a reader of recordings reads from: a local file, or one behind a URL."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, TypeAlias

Span: TypeAlias = tuple[int, int]
"""Offset and number of bytes."""


class NoIndexError(Exception):
    """A file behind a URL has no index that can be trusted; to make one would download it twice."""


class Source(Protocol):
    """A file that is open for reading at any offset."""

    size: int
    is_near: bool
    """Whether the file is local, so that reading all of it is cheap."""

    def read(self, place: int, size: int) -> bytes:
        """Return `size` bytes from an offset; fewer only at the end of the file."""

    def expect(self, spans: Sequence[Span]) -> None:
        """Announce what is read next, in this order, so that it can be fetched ahead and in few requests."""

    def close(self) -> None:
        """Close it."""


class LocalFile:
    """A file of this machine; see Source."""

    is_near = True

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb")
        self.size = os.fstat(self._file.fileno()).st_size
        self.close = self._file.close

    def read(self, place: int, size: int) -> bytes:
        """See Source."""
        self._file.seek(place)
        return self._file.read(size)

    def expect(self, spans: Sequence[Span]) -> None:
        """See Source. The operating system reads ahead by itself."""
