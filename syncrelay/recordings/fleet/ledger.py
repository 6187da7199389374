"""OUT/_ledger.jsonl: a line for each recording that was done, written before its result is put in place."""

import fcntl
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Annotated, Any, Final, Self

from pydantic import AfterValidator, Field, InstanceOf, TypeAdapter

from syncrelay.errors import OutputError, SyncRelayError
from syncrelay.output_files import cannot_be_written
from syncrelay.recordings.fleet.content import ResultFile, flush
from syncrelay.recordings.fleet.recordings import is_result_name
from syncrelay.recordings.fleet.task import NOTES, PROBLEMS

# Programs that read a folder of Parquet files as one table skip names that begin with `_`.
LEDGER: Final = "_ledger.jsonl"
_HEAD: Final = b'{"syncrelay_ledger": 1}\n'


class State(StrEnum):
    """What became of a recording: it has a result, it failed and will be tried again, or its result was removed."""

    DONE = "done"
    FAILED = "failed"
    REMOVED = "removed"


def _result_name(name: str) -> str:
    if not is_result_name(name):
        raise ValueError("is not the name of a result")
    return name


# Paths may hold bytes that are not UTF-8, as lone surrogates, which pydantic's own check of a str refuses.
_Text = InstanceOf[str]


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the ledger; the last line of a name counts.

    `recording` is its absolute path or URL, `content` the hash of its bytes, empty if they could not be read, and
    `size` how many there are. `error` says why it failed.
    """

    name: Annotated[_Text, AfterValidator(_result_name)]
    state: State
    recording: _Text
    fingerprint: _Text
    content: _Text = ""
    size: Annotated[int, Field(alias="bytes")] = 0
    error: _Text = ""
    facts: dict[str, Any] = field(default_factory=dict)
    files: dict[str, ResultFile] = field(default_factory=dict)


_ENTRY: Final = TypeAdapter(Entry)


class Ledger:
    """The ledger of a folder, locked for this process; a context manager that releases it.

    The lock ends with the process. Forked workers do not hold it.
    """

    def __init__(self, folder: Path) -> None:
        """Open the ledger of a folder, and make both if they are not there.

        Raises SyncRelayError if another command is working in the folder, or it holds something else.
        """
        self.folder = folder
        self.entries: dict[str, Entry] = {}
        """The last entry of each name, with PROBLEMS and NOTES as its only facts: there may be 100,000 entries."""
        self.unreadable = 0
        """How many lines could not be read."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if not (folder / LEDGER).exists() and any(folder.iterdir()):
                raise SyncRelayError(f"{folder}: holds files and no {LEDGER}: name an empty folder, or one that is new")
            self._file = FileIO(folder / LEDGER, "a+")
        except OSError as error:
            raise cannot_be_written(folder, error) from error
        try:
            self._lock()
            self._read()
        except BaseException as error:
            self._file.close()
            if isinstance(error, OSError):
                raise cannot_be_written(folder / LEDGER, error) from error
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def append(self, entry: Entry) -> None:
        """Write a line and flush it to the disk. Raises SyncRelayError if there is no space for it."""
        # What is empty is left out.
        line = json.dumps(_ENTRY.dump_python(entry, by_alias=True, exclude_defaults=True)).encode() + b"\n"
        end = os.fstat(self._file.fileno()).st_size
        try:
            written = self._file.write(line)
            os.fsync(self._file.fileno())
        except OSError as error:
            self._file.truncate(end)
            raise cannot_be_written(self.folder / LEDGER, error) from error
        if written != len(line):
            self._file.truncate(end)
            raise OutputError(f"{self.folder / LEDGER}: cannot be written: no space left")
        self._keep(entry)

    def _lock(self) -> None:
        try:
            # A lock of flock would be inherited by forked workers, and outlast a command that is killed.
            fcntl.lockf(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise SyncRelayError(f"{self.folder}: another command is at work in it: wait for it to end") from error
        except OSError as error:
            raise SyncRelayError(f"{self.folder}: cannot be locked: {error.strerror}: name another folder") from error

    def _read(self) -> None:
        self._file.seek(0)
        content = self._file.readall()
        whole_lines = content.rfind(b"\n") + 1
        if not whole_lines and _HEAD.startswith(content):
            # A new file, or one whose command was killed while it wrote the first line.
            self._file.truncate(0)
            self._file.write(_HEAD)
            os.fsync(self._file.fileno())
            flush(self.folder)
            return
        if not content.startswith(_HEAD):
            raise SyncRelayError(f"{self.folder / LEDGER}: is not a ledger of this syncrelay: name another folder")
        if whole_lines < len(content):
            self._file.truncate(whole_lines)
        for entry in _entries(content[:whole_lines]):
            if entry is None:
                self.unreadable += 1
            else:
                self._keep(entry)

    def _keep(self, entry: Entry) -> None:
        facts = {name: fact for name, fact in entry.facts.items() if name in (PROBLEMS, NOTES)}
        self.entries[entry.name] = replace(entry, facts=facts)


def _entries(content: bytes) -> Iterator[Entry | None]:
    """Yield the whole lines after the first; None stands for a line that a power failure or an editor damaged."""
    for line in content.split(b"\n")[1:-1]:
        try:
            yield _ENTRY.validate_python(json.loads(line))
        except (ValueError, RecursionError):
            yield None
