"""OUT/_ledger.jsonl: what was done to which recording, a line each, written before its result is put in place."""

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from syncrelay.errors import OutputError, SyncRelayError
from syncrelay.output_files import cannot_be_written
from syncrelay.recordings.fleet.content import ResultFile, sync_folder
from syncrelay.recordings.fleet.recordings import is_result_name
from syncrelay.recordings.fleet.task import JSON, NOTES, PROBLEMS

# What reads a folder of Parquet files as one table skips names that begin with `_`.
LEDGER: Final = "_ledger.jsonl"
_HEAD: Final = b'{"syncrelay_ledger": 1}\n'


class State(Enum):
    """What became of a recording: its result is there, it is to be tried again, or its result was taken away."""

    DONE = "done"
    FAILED = "failed"
    REMOVED = "removed"


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the ledger; the last one of a name counts.

    `recording` is what was read, `content` the hash of it, empty where it could not be read. `error` is why it failed.
    """

    name: str
    state: State
    recording: tuple[str, ...]
    fingerprint: str
    content: str = ""
    size: int = 0
    error: str = ""
    facts: Mapping[str, JSON] = field(default_factory=dict)
    files: Mapping[str, ResultFile] = field(default_factory=dict)


class Ledger:
    """The ledger of a folder, held by this process alone; a context manager that lets go of it.

    The lock ends with the process, and workers that were forked do not hold it.
    """

    def __init__(self, folder: Path) -> None:
        """Open the ledger of a folder, which is made if it is not there.

        Raises SyncRelayError where another command is at work in it, or it holds something else.
        """
        self.folder = folder
        self.entries: dict[str, Entry] = {}
        """The last entry of each name; of its facts only PROBLEMS and NOTES, as there may be very many."""
        self.unreadable = 0
        """How many lines told nothing."""
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
        """Write a line, which outlasts a loss of power. Raises SyncRelayError where there is no space for it."""
        line = json.dumps(_as_json(entry)).encode() + b"\n"
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
            # Not flock: that lock would pass on to forked workers, and outlast a command that is killed by as much.
            fcntl.lockf(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise SyncRelayError(f"{self.folder}: another command is at work in it: wait for it to end") from error
        except OSError as error:
            raise SyncRelayError(f"{self.folder}: cannot be locked: {error.strerror}: name another folder") from error

    def _read(self) -> None:
        content = self._content()
        kept = content.rfind(b"\n") + 1
        if not kept and _HEAD.startswith(content):
            # New, or of a command that was killed as it began.
            self._file.truncate(0)
            self._file.write(_HEAD)
            os.fsync(self._file.fileno())
            sync_folder(self.folder)
            return
        if not content.startswith(_HEAD):
            raise SyncRelayError(f"{self.folder / LEDGER}: is not a ledger of this syncrelay: name another folder")
        if kept < len(content):
            self._file.truncate(kept)
        for line in content[len(_HEAD) : kept].split(b"\n")[:-1]:
            entry = _entry(line)
            if entry is None:
                self.unreadable += 1
            else:
                self._keep(entry)

    def _keep(self, entry: Entry) -> None:
        facts = {name: fact for name, fact in entry.facts.items() if name in (PROBLEMS, NOTES)}
        self.entries[entry.name] = replace(entry, facts=facts)

    def _content(self) -> bytes:
        self._file.seek(0)
        return self._file.readall()


def read_ledger(folder: Path) -> list[Entry]:
    """Return the last entry of each recording in a folder, by their names, also while a command is at work in it.

    Raises SyncRelayError where there is no ledger.
    """
    try:
        content = (folder / LEDGER).read_bytes()
    except OSError as error:
        raise SyncRelayError(f"{folder}: its {LEDGER} cannot be read: {error.strerror}") from error
    entries = {entry.name: entry for line in content.split(b"\n")[1:-1] if (entry := _entry(line)) is not None}
    return [entries[name] for name in sorted(entries)]


def _as_json(entry: Entry) -> dict[str, Any]:
    """Return a line; what is empty is left out."""
    line: dict[str, Any] = {
        "name": entry.name,
        "state": entry.state.value,
        "recording": list(entry.recording),
        "fingerprint": entry.fingerprint,
        "content": entry.content,
        "bytes": entry.size,
        "error": entry.error,
        "facts": dict(entry.facts),
        "files": {name: {"bytes": file.size, "blake2b": file.hash} for name, file in entry.files.items()},
    }
    return {key: value for key, value in line.items() if value not in ("", 0, {})}


def _entry(line: bytes) -> Entry | None:
    """Read a line; None for one that a loss of power or an editor left without a meaning."""
    try:
        found = json.loads(line)
        entry = Entry(
            name=found["name"],
            state=State(found["state"]),
            recording=tuple(found["recording"]),
            fingerprint=found["fingerprint"],
            content=found.get("content", ""),
            size=found.get("bytes", 0),
            error=found.get("error", ""),
            facts=found.get("facts", {}),
            files=dict(_files(found.get("files", {}))),
        )
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    return entry if _is_in_order(entry) else None


def _is_in_order(entry: Entry) -> bool:
    texts = (entry.name, entry.fingerprint, entry.content, entry.error, *entry.recording)
    return (
        all(isinstance(text, str) for text in texts)
        and is_result_name(entry.name)
        and isinstance(entry.size, int)
        and isinstance(entry.facts, dict)
    )


def _files(found: Mapping[str, Any]) -> Iterator[tuple[str, ResultFile]]:
    for name, file in found.items():
        yield name, ResultFile(file["bytes"], file["blake2b"])
