"""What a worker does with one recording, wherever it works."""

import ctypes
import shutil
import signal
import socket
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from errno import EROFS
from pathlib import Path
from typing import Final, TypeAlias
from uuid import uuid4

from syncrelay import own_version
from syncrelay.errors import NO_SPACE, BagError, OutputError, SyncRelayError
from syncrelay.recordings.fleet.content import Content, ResultFile, are_intact, content_of, marks_of, results_in
from syncrelay.recordings.fleet.ledger import LEDGER, Entry
from syncrelay.recordings.fleet.task import JSON, Source, Task

SCRATCH: Final = ".partial"
"""The folder in OUT where results are written before they are put in place."""

_NS_PER_SECOND: Final = 1_000_000_000
# Ten minutes, and a hundred kilobytes a second: a tenth of what encoding videos on a slow machine takes.
_LEAST_LIMIT: Final = 600 * _NS_PER_SECOND
_LIMIT_PER_BYTE: Final = _NS_PER_SECOND // 100_000
_PR_SET_PDEATHSIG: Final = 1


@dataclass(frozen=True, slots=True)
class Job:
    """One recording of a run: its source, where results go, and what the ledger tells of a result that should be there.

    `version` is the driver's: a worker of another would give other results. `size` is in bytes, 0 where not known.
    """

    source: Source
    task: Task
    into: Path
    done: Entry | None
    size: int
    version: str
    time_limit: int | None = None
    """How many nanoseconds it may take; None for what its size makes plausible."""

    @property
    def scratch(self) -> Path:
        """The folder for results that are not finished."""
        return self.into / SCRATCH

    def scratch_folder(self) -> Path:
        """Return a new name for a result: a worker that was given up for lost may still be writing."""
        return self.scratch / f"{self.source.name}.{uuid4().hex}"

    def remove_scratch(self) -> None:
        """Remove what lost workers left of it."""
        for folder in self.scratch.iterdir():
            if folder.name.startswith(f"{self.source.name}."):
                shutil.rmtree(folder, ignore_errors=True)


@dataclass(frozen=True, slots=True)
class Done:
    """A result, finished and safe on the disk, in a folder of its own that is to be put in place."""

    content: Content
    facts: Mapping[str, JSON]
    files: Mapping[str, ResultFile]
    folder: Path


@dataclass(frozen=True, slots=True)
class Kept:
    """The result that is there is that of this very content."""


@dataclass(frozen=True, slots=True)
class Failed:
    """There is no result, and why: because of the recording, or of a bug of ours.

    `ends_all`: the next recordings would fail as well.
    """

    why: str
    content: str = ""
    is_bug: bool = False
    ends_all: bool = False


Outcome: TypeAlias = Done | Kept | Failed


def limit_of(job: Job, size: int) -> int:
    """Return how many nanoseconds a job may take whose recording has so many bytes."""
    return _LEAST_LIMIT + _LIMIT_PER_BYTE * size if job.time_limit is None else job.time_limit


def perform(job: Job) -> Outcome:
    """Do a job; whatever goes wrong is its outcome.

    The kernel ends this process by SIGALRM where that takes too long: nothing that a recording has us do prevents it.
    """
    _end_after(limit_of(job, job.size))
    try:
        return _performed(job)
    finally:
        _end_after(0)


def _end_after(duration: int) -> None:
    """Have SIGALRM end this process after so many nanoseconds, never after 0."""
    signal.setitimer(signal.ITIMER_REAL, duration / _NS_PER_SECOND)


def _performed(job: Job) -> Outcome:
    folder = job.scratch_folder()
    if (why := _unfit(job)) is not None:
        return Failed(why, ends_all=True)
    content = ""
    try:
        found = content_of(job.source.words)
        content = found.hash
        # The size of what is behind a URL is known only now.
        _end_after(limit_of(job, found.size))
        if job.done is not None and job.done.content == content and _is_there(job, job.done):
            return Kept()
        return _done(job, found, folder)
    except SyncRelayError as error:
        failed = Failed(str(error), content, ends_all=isinstance(error, OutputError))
    except MemoryError:
        failed = Failed(f"{job.source.shown[0]}: takes more memory than a worker has: use fewer --jobs", content)
    except OSError as error:
        if error.errno not in (*NO_SPACE, EROFS):
            failed = Failed(traceback.format_exc(), content, is_bug=True)
        else:
            failed = Failed(f"{job.into}: cannot be written: {error.strerror}", content, ends_all=True)
    except Exception:  # noqa: BLE001  a bug on one recording is no reason to leave out the others
        failed = Failed(traceback.format_exc(), content, is_bug=True)
    shutil.rmtree(folder, ignore_errors=True)
    return failed


def _done(job: Job, content: Content, folder: Path) -> Done:
    folder.mkdir(parents=True)
    facts = job.task.run(job.source, folder)
    if marks_of(job.source.words) != content.marks:
        raise BagError(f"{job.source.shown[0]}: was changed while it was read: is it still being recorded?")
    return Done(content, facts, results_in(folder), folder)


def end_with_parent() -> None:
    """Have the kernel end this process when its parent ends, however that ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _unfit(job: Job) -> str | None:
    """Say why no job can be done here, as on another machine that is set up in another way."""
    if own_version() != job.version:
        return f"{socket.gethostname()} has syncrelay {own_version()}, expected {job.version}: install the same version"
    if not (job.into / LEDGER).exists():
        return f"{job.into}: is not seen from {socket.gethostname()}: name a folder that all machines share"
    return None


def _is_there(job: Job, done: Entry) -> bool:
    return are_intact(job.into / job.source.name, done.files.items())
