"""What a worker does with one recording, wherever it works."""

import ctypes
import shutil
import signal
import socket
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from errno import EDQUOT, ENOSPC, EROFS
from pathlib import Path
from typing import Final, TypeAlias
from uuid import uuid4

from syncrelay import own_version
from syncrelay.errors import BagError, SyncRelayError
from syncrelay.fleet.content import Content, ResultFile, are_intact, content_of, marks_of, results_in
from syncrelay.fleet.ledger import LEDGER, Entry
from syncrelay.fleet.task import JSON, Source, Task

SCRATCH: Final = ".partial"
"""The folder in OUT where results are written before they are put in place."""

_PR_SET_PDEATHSIG: Final = 1
_NO_SPACE: Final = (ENOSPC, EDQUOT, EROFS)


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

    @property
    def scratch(self) -> Path:
        """The folder for results that are not finished."""
        return self.into / SCRATCH


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


def perform(job: Job) -> Outcome:
    """Do a job; whatever goes wrong is its outcome."""
    # Of its own: a worker that was given up for lost may still be writing.
    folder = job.scratch / f"{job.source.name}.{uuid4().hex}"
    if (why := _unfit(job)) is not None:
        return Failed(why, ends_all=True)
    content = ""
    try:
        found = content_of(job.source.words)
        content = found.hash
        if job.done is not None and job.done.content == content and _is_there(job, job.done):
            return Kept()
        return _result(job, found, folder)
    except SyncRelayError as error:
        failed = Failed(str(error), content)
    except MemoryError:
        failed = Failed(f"{job.source.shown[0]}: takes more memory than a worker has: use fewer --jobs", content)
    except OSError as error:
        if error.errno not in _NO_SPACE:
            failed = Failed(traceback.format_exc(), content, is_bug=True)
        else:
            failed = Failed(f"{job.into}: cannot be written: {error.strerror}", content, ends_all=True)
    except Exception:  # noqa: BLE001  a bug on one recording is no reason to leave out the others
        failed = Failed(traceback.format_exc(), content, is_bug=True)
    shutil.rmtree(folder, ignore_errors=True)
    return failed


def end_with_parent() -> None:
    """Have the kernel end this process when its parent ends, however that ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def remove_scratch_of(job: Job) -> None:
    """Remove what lost workers left of a job."""
    for folder in job.scratch.iterdir():
        if folder.name.startswith(f"{job.source.name}."):
            shutil.rmtree(folder, ignore_errors=True)


def _unfit(job: Job) -> str | None:
    """Say why no job can be done here, as on another machine that is set up in another way."""
    if own_version() != job.version:
        return f"{socket.gethostname()} has syncrelay {own_version()}, expected {job.version}: install the same version"
    if not (job.into / LEDGER).exists():
        return f"{job.into}: is not seen from {socket.gethostname()}: name a folder that all machines share"
    return None


def _is_there(job: Job, done: Entry) -> bool:
    return are_intact(job.into / job.source.name, done.files.items())


def _result(job: Job, content: Content, folder: Path) -> Done:
    folder.mkdir(parents=True)
    facts = job.task.run(job.source, folder)
    if marks_of(job.source.words) != content.marks:
        raise BagError(f"{job.source.shown[0]}: was changed while it was read: is it still being recorded?")
    return Done(content, facts, results_in(folder), folder)
