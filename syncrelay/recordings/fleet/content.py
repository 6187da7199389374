"""Hashes of the content of recordings and of result files, by which the ledger recognizes them."""

import os
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path
from typing import Annotated

from pydantic import Field
from xxhash import xxh128

from syncrelay.errors import BagError
from syncrelay.recordings.bag.listing import local_files
from syncrelay.recordings.bag.remote_file import RemoteFile
from syncrelay.recordings.bag.storage import files_of, is_url
from syncrelay.urls import redacted


@dataclass(frozen=True, slots=True)
class Content:
    """The hash of a recording's content, and its size in bytes.

    `marks` are sizes, times and inodes of its files: they change while a recording is still being written.
    """

    hash: str
    size: int
    marks: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True)
class ResultFile:
    """A file of a result: its size in bytes, and the hash of its content."""

    size: Annotated[int, Field(alias="bytes")]
    hash: Annotated[str, Field(alias="xxh128")]


def content_of(place: str) -> Content:
    """Read all bytes of a recording's files; for a URL, ask its server. Raises BagError if that is not possible."""
    if is_url(place):
        return _of_url(place)
    files = local_files(place)
    marks = _marks(files)
    hashes = [_hash(path) for path in files]
    # The order of the parts of a split recording is that of their names.
    named = [f"{path.name} {each}" for path, each in zip(files, hashes, strict=True)]
    return Content(hashes[0] if len(hashes) == 1 else _of_several(named), sum(mark[0] for mark in marks), marks)


def marks_of(place: str) -> tuple[tuple[int, ...], ...]:
    """Return the marks of a recording, see Content, without reading its files; a URL has none."""
    return () if is_url(place) else _marks(local_files(place))


def size_of(place: str) -> int:
    """Return the size of a recording's files in bytes; 0 for URLs, and if it cannot be told without reading."""
    try:
        return sum(mark[0] for mark in marks_of(place))
    except BagError:
        return 0


def results_in(folder: Path) -> dict[str, ResultFile]:
    """Return the files of a result by their paths in its folder."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if not path.is_dir():
            with path.open("rb") as file:
                digest = file_digest(file, xxh128).hexdigest()
            found[path.relative_to(folder).as_posix()] = ResultFile(path.stat().st_size, digest)
    return found


def are_intact(folder: Path, files: Mapping[str, ResultFile]) -> bool:
    """Tell whether a folder holds exactly these files of a result, as they were written."""
    try:
        return results_in(folder) == files
    except OSError:
        return False


def flush(path: Path) -> None:
    """Flush a file, or the names in a folder, to the disk (fsync)."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def _of_url(word: str) -> Content:
    """Return the ETag or date that a server gives for a URL, and the size; nothing is read."""
    parts = []
    for url in files_of(word):
        with closing(RemoteFile(url)) as file:
            if not file.identity:
                raise BagError(
                    f"{redacted(url)}: its server tells no ETag and no date, by which a change of it would be seen:"
                    " download it"
                )
            parts.append((f"{file.identity}:{file.size}", file.size))
    hashes = [told for told, _ in parts]
    return Content(_of_several(hashes), sum(size for _, size in parts), ())


def _of_several(lines: Sequence[str]) -> str:
    return f"xxh128:{xxh128(os.fsencode(chr(10).join(lines))).hexdigest()}"


def _hash(path: Path) -> str:
    try:
        if not path.is_file():
            raise BagError(f"{path}: is not a regular file, as a recording has to be")
        with path.open("rb") as file:
            return f"xxh128:{file_digest(file, xxh128).hexdigest()}"
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror}") from error


def _marks(files: Sequence[Path]) -> tuple[tuple[int, ...], ...]:
    try:
        found = [path.stat() for path in files]
    except OSError as error:
        raise BagError(f"{error.filename}: cannot be read: {error.strerror}") from error
    return tuple((each.st_size, each.st_mtime_ns, each.st_ino) for each in found)
