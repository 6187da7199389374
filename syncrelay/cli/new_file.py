"""Files that a command writes, and never over something of the user's."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Final

from syncrelay.cli.boundary import remark
from syncrelay.errors import BagError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from syncrelay.bag.analysis.changes import Change

_HEAD: Final = 500


def require_new(name: str) -> None:
    """Raise BagError where a file is there already, or has no folder to be in, before work is done for it."""
    path = Path(name)
    if os.path.lexists(path):
        raise BagError(_is_there(path))
    if not path.parent.is_dir():
        raise BagError(f"{path}: cannot be written: {path.parent} is not a folder")


def write_new(name: str, text: str) -> None:
    """Write a file that is not there yet, and say so; raises BagError for one that is, or cannot be written."""
    path = Path(name)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise BagError(_is_there(path)) from error
    except OSError as error:
        raise BagError(f"{path}: cannot be written: {error.strerror}") from error
    remark(f"wrote {path}")


def write_suggested(name: str, text: str, changes: "Sequence[Change]") -> None:
    """Write a file's text with suggested values as write_new does; where there are none, say so instead."""
    if not changes:
        remark(f"no values to change: {name} was not written")
        return
    from syncrelay.bag.analysis import file_with_changes

    write_new(name, file_with_changes(text, changes))


def write_again(name: str, text: str, *, mark: str) -> None:
    """Write a file as write_new does, but also over one that has a mark near its begin: a former one of the kind."""
    path = Path(name)
    if path.is_file() and _bears(path, mark):
        path.unlink()
    write_new(name, text)


def _is_there(path: Path) -> str:
    return f"{path}: already exists and is not overwritten"


def _bears(path: Path, mark: str) -> bool:
    try:
        with path.open("rb") as file:
            return mark.encode() in file.read(_HEAD)
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror}") from error
