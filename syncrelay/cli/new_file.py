"""Files that a command writes. It never replaces a file of the user's."""

from typing import TYPE_CHECKING, Final

from syncrelay.cli.boundary import remark
from syncrelay.output_files import begins_with, require_new, written_whole
from syncrelay.urls import redacted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from syncrelay.recordings.analysis.changes import Change

_HEAD: Final = 500


def write_new(name: str, text: str) -> None:
    """Write a new file, and say so; raises OutputError if it exists or cannot be written."""
    require_new(name)
    _write(name, text)


def write_suggested(name: str, text: str, changes: "Sequence[Change]") -> None:
    """Write a file's text with the suggested values as a new file; if there are none, say so instead."""
    if not changes:
        remark(f"no values to change: {name} was not written")
        return
    from syncrelay.recordings.analysis import file_with_changes

    write_new(name, file_with_changes(text, changes))


def write_again(name: str, text: str, *, mark: str) -> None:
    """Write a new file, or replace one that has a mark near its begin: an earlier file of the same kind."""
    if mark.encode() not in begins_with(name, _HEAD):
        require_new(name)
    _write(name, text)


def _write(name: str, text: str) -> None:
    with written_whole(name) as scratch:
        scratch.write_text(text, encoding="utf-8")
    remark(f"wrote {redacted(name)}")
