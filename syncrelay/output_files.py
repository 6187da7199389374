"""Files that are written: whole or not at all, on a full disk too; behind URLs as far as their store allows."""

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, Final, TypeVar

from syncrelay.errors import NO_SPACE, OutputError, StorageError
from syncrelay.recording_files import METADATA, scheme_of
from syncrelay.urls import LOCAL, SERVERS, file_system, redacted, tried

_PREFIX: Final = ".syncrelay-"
# Schemes of stores without folders, in which to make one would make a bucket.
_BUCKETS: Final = ("s3", "gs")
_Done = TypeVar("_Done")


def local_path(place: Path | str) -> Path | None:
    """Return the path that a place on this machine has; None for a place in a store."""
    scheme = scheme_of(str(place))
    if scheme in LOCAL:
        return Path(file_system(str(place))[1])
    return None if scheme else Path(place)


def require_new(place: Path | str) -> None:
    """Raise OutputError where something is there already, or has no folder to be in, before work is done for it."""
    path = local_path(place)
    if path is None:
        _require_new_in_store(str(place))
        return
    if os.path.lexists(path):
        raise OutputError(f"{path}: already exists and is not overwritten")
    if not path.parent.is_dir():
        raise OutputError(f"{path}: cannot be written: {path.parent} is not a folder")


def begins_with(place: Path | str, size: int) -> bytes:
    """Return the first bytes of a file, up to a size; none where there is no such file. Raises OutputError."""
    path = local_path(place)
    if path is None:
        files, where = _store(str(place))
        about = _about(str(place), where, files)
        end = min(size, about.get("size") or 0) if about.get("type") == "file" else 0
        return bytes(_written(str(place), lambda: files.cat_file(where, start=0, end=end))) if end else b""
    if not path.is_file():
        return b""
    try:
        with path.open("rb") as file:
            return file.read(size)
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror}") from error


@contextmanager
def written_whole(place: Path | str) -> Iterator[Path]:
    """Give a name to write a file or a folder to; it is put in its place at the end, and removed at an error.

    What goes into a store is written to a temporary folder of this machine and then uploaded. Raises OutputError where
    there is no space, or the place may not be written.
    """
    path = local_path(place)
    if path is None:
        _store(str(place))
    try:
        # Both names from the root: a folder that was entered from another mount namespace is not the one of that name.
        target = None if path is None else path.absolute()
        scratch = Path(tempfile.mkdtemp(dir=None if target is None else target.parent, prefix=_PREFIX))
    except OSError as error:
        raise (cannot_be_written(place, error) if path is not None else _no_scratch(place, error)) from error
    try:
        finished = scratch / PurePosixPath(place).name
        yield finished
        if target is None:
            upload(finished, str(place))
        else:
            finished.replace(target)
    except OSError as error:
        # What is read meanwhile may fail, too.
        if error.errno not in NO_SPACE and not str(error.filename).startswith(str(scratch)):
            raise
        raise (_no_scratch(place, error) if target is None else cannot_be_written(place, error)) from error
    finally:
        with suppress(OSError):
            shutil.rmtree(scratch)


def remove_leftovers(folder: Path) -> None:
    """Remove what killed commands left of files that they were writing into a folder, see written_whole."""
    for path in folder.glob(f"{_PREFIX}*"):
        shutil.rmtree(path, ignore_errors=True)


def upload(source: Path, url: str) -> None:
    """Put a file, or all that is in a folder, behind a URL; what tells of the other files comes last.

    A store has a file whole or not at all, but cannot have several at once. Raises OutputError.
    """
    files, where = _store(url)
    paths = [source] if source.is_file() else [each for each in source.rglob("*") if each.is_file()]
    for path in sorted(paths, key=lambda each: (each.name == METADATA, each)):
        target = where if path == source else f"{where.rstrip('/')}/{path.relative_to(source).as_posix()}"
        if scheme_of(url) not in _BUCKETS:
            _written(url, partial(files.makedirs, target.rpartition("/")[0], exist_ok=True))
        _written(url, partial(files.put_file, str(path), target))


def remove_from_store(url: str) -> None:
    """Remove what is behind a URL, and below it; nothing where nothing is there. Raises OutputError."""
    files, where = _store(url)
    if _about(url, where, files):
        _written(url, lambda: files.rm(where, recursive=True))


def sizes_in_store(url: str) -> dict[str, int]:
    """Return the sizes of the files below a URL, by their paths below it. Raises OutputError."""
    files, where = _store(url)
    found = _written(url, lambda: files.find(where, detail=True))
    return {path[len(where.rstrip("/")) + 1 :]: int(about["size"]) for path, about in found.items()}


def cannot_be_written(place: Path | str, error: OSError) -> OutputError:
    """Return the error for a file or folder that the system refused to write."""
    return OutputError(f"{redacted(str(place))}: cannot be written: {error.strerror or error}")


def _no_scratch(place: Path | str, error: OSError) -> OutputError:
    why = f"cannot be written to a temporary folder of this machine before the upload: {error.strerror or error}"
    return OutputError(f"{redacted(str(place))}: {why}: set TMPDIR to another folder")


def _store(url: str) -> tuple[Any, str]:
    if scheme_of(url) in SERVERS:
        raise OutputError(f"{redacted(url)}: a server takes no files: expected a path, s3://, gs:// or another store")
    return _written(url, lambda: file_system(url))


def _written(url: str, work: Callable[[], _Done]) -> _Done:
    try:
        return tried(url, work)
    except StorageError as error:
        raise OutputError(str(error)) from error
    except OSError as error:
        # The store is full: tried() passes on no other.
        raise cannot_be_written(url, error) from error


def _about(url: str, where: str, files: Any) -> dict[str, Any]:
    """Return what a store says of a file or folder; nothing where it has none."""

    def look() -> dict[str, Any]:
        try:
            return dict(files.info(where))
        except FileNotFoundError:
            return {}

    return _written(url, look)


def _require_new_in_store(url: str) -> None:
    files, where = _store(url)
    if _about(url, where, files):
        raise OutputError(f"{redacted(url)}: already exists and is not overwritten")
    bucket = where.lstrip("/").partition("/")[0]
    if scheme_of(url) in _BUCKETS and not _about(url, bucket, files):
        raise OutputError(f"{redacted(url)}: cannot be written: there is no bucket {bucket}")
