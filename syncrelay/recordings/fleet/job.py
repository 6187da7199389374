"""A recording that a worker is to do, what can come of it, and the protocol of what drives workers."""

import shutil
from collections.abc import Generator, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, Protocol, TypeAlias
from uuid import uuid4

from syncrelay.recordings.fleet.content import Content, ResultFile
from syncrelay.recordings.fleet.ledger import Entry
from syncrelay.recordings.fleet.store import ResultStore
from syncrelay.recordings.fleet.task import JSON, Source, Task

SCRATCH: Final = ".partial"
"""The folder in OUT where results are written before they are put in place."""

TICK_S: Final = 0.2
"""An engine yields at least this often, so that progress is shown."""

TRIES: Final = 3
"""How often a job is begun if its worker dies."""

_NS_PER_SECOND: Final = 1_000_000_000
# 10 min and 10 s for each MB: a tenth of the speed of encoding videos on a slow machine.
_LEAST_LIMIT: Final = 600 * _NS_PER_SECOND
_LIMIT_PER_BYTE: Final = _NS_PER_SECOND // 100_000


@dataclass(frozen=True, slots=True)
class Job:
    """One recording of a run: its source, where the result goes, and the ledger's entry if it should be there already.

    `version` is that of the command: a worker with another version would give other results. `size` is in bytes, 0 if
    it is not known. `time_limit` is in nanoseconds; None for one that depends on the size.
    """

    source: Source
    task: Task
    into: Path
    done: Entry | None
    size: int
    version: str
    time_limit: int | None = None
    store: ResultStore | None = None
    """Where the result is uploaded to; `into` then holds only what is not finished."""

    def limit_of(self, size: int) -> int:
        """Return how many nanoseconds the job may take if the recording has so many bytes."""
        return _LEAST_LIMIT + _LIMIT_PER_BYTE * size if self.time_limit is None else self.time_limit

    def scratch_folder(self) -> Path:
        """Return a new folder name for a result: a worker that was taken for dead may still be writing."""
        return self.into / SCRATCH / f"{self.source.name}.{uuid4().hex}"

    def remove_scratch(self) -> None:
        """Remove what dead workers left."""
        for folder in (self.into / SCRATCH).iterdir():
            if folder.name.startswith(f"{self.source.name}."):
                shutil.rmtree(folder, ignore_errors=True)


@dataclass(frozen=True, slots=True)
class Done:
    """A finished result: uploaded, or flushed to the disk in a scratch folder from which it is to be put in place."""

    content: Content
    facts: Mapping[str, JSON]
    files: Mapping[str, ResultFile]
    folder: Path


@dataclass(frozen=True, slots=True)
class Kept:
    """The result is there already, and the recording has not changed since."""


@dataclass(frozen=True, slots=True)
class Failed:
    """There is no result; `why` is a sentence, or the traceback of a bug. `ends_all`: all other jobs would fail too."""

    why: str
    content: str = ""
    is_bug: bool = False
    ends_all: bool = False


Outcome: TypeAlias = Done | Kept | Failed


class Finished(NamedTuple):
    """A job and what came of it."""

    job: Job
    outcome: Outcome


class Engine(Protocol):
    """Does jobs, several at a time and in any order: on this machine's cores, or on a Ray cluster."""

    def run(self, jobs: Iterable[Job]) -> Generator[Finished | None, None, None]:
        """Yield each job when it has ended, and None at least every TICK_S; jobs are taken as there is room for them.

        Closing the generator ends all workers. A worker that dies costs its own job a try, and no other job.
        """
        ...


def took_too_long(job: Job) -> str:
    """Return the sentence for a job that was ended because of its time limit."""
    limit = "10 min and 10 s for each MB" if job.time_limit is None else f"{job.time_limit / _NS_PER_SECOND:g} s"
    return f"{job.source.shown}: not done within {limit}: check it, or give it longer by --time-limit"


def given_up(job: Job, why: str) -> str:
    """Return the sentence for a job whose workers died."""
    return f"{job.source.shown}: {why} {TRIES} times: check whether there is enough memory, or use fewer --jobs"
