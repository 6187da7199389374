"""Files that are written: whole or not at all, also on a disk that is full."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from syncrelay.errors import NO_SPACE, OutputError

_PREFIX: Final = ".syncrelay-"


def require_new(path: Path) -> None:
    """Raise OutputError where something is there already, or has no folder to be in, before work is done for it."""
    if os.path.lexists(path):
        raise OutputError(f"{path}: already exists and is not overwritten")
    if not path.parent.is_dir():
        raise OutputError(f"{path}: cannot be written: {path.parent} is not a folder")


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Give a name to write a file or a folder to; it is put in the place of `path` at the end, and removed at an error.

    Raises OutputError where there is no space, or the folder may not be written.
    """
    try:
        # Both names from the root: a folder that was entered from another mount namespace is not the one of that name.
        target = path.absolute()
        scratch = Path(tempfile.mkdtemp(dir=target.parent, prefix=_PREFIX))
    except OSError as error:
        raise cannot_be_written(path, error) from error
    try:
        yield scratch / path.name
        (scratch / path.name).replace(target)
    except OSError as error:
        # What is read meanwhile may fail, too.
        if error.errno in NO_SPACE or str(error.filename).startswith(str(scratch)):
            raise cannot_be_written(path, error) from error
        raise
    finally:
        with suppress(OSError):
            shutil.rmtree(scratch)


def cannot_be_written(path: Path | str, error: OSError) -> OutputError:
    """Return the error for a file or folder that the system refused to write."""
    return OutputError(f"{path}: cannot be written: {error.strerror or error}")
