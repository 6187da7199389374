"""A run: which recordings are to be done, the results put in place, and the ledger that tells of them."""

import os
import shutil
from collections.abc import Generator, Sequence
from contextlib import closing
from enum import Enum
from pathlib import Path
from typing import Final, Self

from syncrelay import own_version
from syncrelay.errors import SyncRelayError
from syncrelay.output_files import cannot_be_written
from syncrelay.recordings.fleet.content import size_of, sync_folder
from syncrelay.recordings.fleet.engine import Engine, Finished
from syncrelay.recordings.fleet.ledger import Entry, Ledger, State
from syncrelay.recordings.fleet.task import Source, Task
from syncrelay.recordings.fleet.work import SCRATCH, Done, Failed, Job, Kept


class Others(Enum):
    """What becomes of results that another file, version or option of a command gave."""

    REFUSED = "refused"
    REPLACED = "replaced"


class Run:
    """A task on recordings, into a folder that this process alone writes to; a context manager."""

    def __init__(
        self, task: Task, sources: Sequence[Source], *, into: Path, others: Others, time_limit: int | None = None
    ) -> None:
        """Open the folder and remove what a killed run left in it. `time_limit` is that of each Job.

        Raises SyncRelayError where it cannot be used, or holds what is not to be replaced.
        """
        self._task = task
        self._time_limit = time_limit
        self._fingerprint = task.fingerprint()
        self._ledger = Ledger(into)
        self.unreadable = self._ledger.unreadable
        """How many lines of the ledger told nothing; what they told of is done again."""
        try:
            self._take_over({source.name for source in sources}, others)
            _clear(into / SCRATCH)
        except BaseException:
            self._ledger.__exit__(None, None, None)
            raise
        version = own_version()
        jobs = [self._job(source, into, version) for source in sources]
        # The longest first: none of them is begun when all others are done.
        self.jobs: Final = tuple(sorted(jobs, key=lambda job: -job.size))
        """What there is to do or to look at, in the order in which it is begun."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        shutil.rmtree(self._ledger.folder / SCRATCH, ignore_errors=True)
        self._ledger.__exit__(None, None, None)

    def go(self, engine: Engine) -> Generator[Finished | None, None, None]:
        """Yield each recording once its result is in place and in the ledger, and None as the engine does.

        To close it ends all that is at work.
        """
        with closing(engine.run(self.jobs)) as finished:
            for each in finished:
                if each is not None:
                    self._take(each)
                yield each

    def entry(self, job: Job) -> Entry | None:
        """Return what the ledger tells of a job."""
        return self._ledger.entries.get(job.source.name)

    def _job(self, source: Source, into: Path, version: str) -> Job:
        entry = self._ledger.entries.get(source.name)
        done = entry if entry is not None and self._is_ours(entry) else None
        size = size_of(source.words)
        return Job(source, self._task, into, done, size, version, time_limit=self._time_limit)

    def _is_ours(self, entry: Entry) -> bool:
        return entry.state is State.DONE and entry.fingerprint == self._fingerprint

    def _take(self, finished: Finished) -> None:
        source, outcome = finished.job.source, finished.outcome
        match outcome:
            case Done():
                entry = Entry(
                    name=source.name,
                    state=State.DONE,
                    recording=source.shown,
                    fingerprint=self._fingerprint,
                    content=outcome.content.hash,
                    size=outcome.content.size,
                    facts=dict(outcome.facts),
                    files=dict(outcome.files),
                )
                self._ledger.append(entry)
                _put_in_place(outcome.folder, self._ledger.folder / source.name)
            case Failed() if not outcome.ends_all and (outcome.content or finished.job.done is None):
                self._take_away(source.name)
                failed = (source.name, State.FAILED, source.shown, self._fingerprint, outcome.content)
                entry = Entry(*failed, error=outcome.why)
                if self._ledger.entries.get(source.name) != entry:
                    self._ledger.append(entry)
            case Failed() | Kept():
                # A recording that cannot be reached now keeps the result that it has.
                pass

    def _take_over(self, names: set[str], others: Others) -> None:
        """Refuse results that another command gave, or remove those of them that this one will not replace."""
        strange = [
            entry for entry in self._ledger.entries.values() if entry.state is State.DONE and not self._is_ours(entry)
        ]
        if strange and others is Others.REFUSED:
            raise SyncRelayError(_refusal(self._ledger.folder, strange[0].fingerprint, self._fingerprint))
        for entry in strange:
            if entry.name not in names:
                self._ledger.append(Entry(entry.name, State.REMOVED, entry.recording, entry.fingerprint))
                self._take_away(entry.name)

    def _take_away(self, name: str) -> None:
        """Remove a result: one that is of what the recording no longer is would pass for that of what it is."""
        shutil.rmtree(self._ledger.folder / name, ignore_errors=True)


def _refusal(folder: Path, theirs: str, ours: str) -> str:
    """Say what gave the results that are there, by the lines of fingerprint_of."""
    (command, *its), (own, *mine) = theirs.split() or [""], ours.split()
    parts = {
        "version": "another version of syncrelay",
        "config": "a file with other values",
        "options": "other options",
    }
    differing = [word.partition(":")[0] for word in mine if word not in its]
    what = " and ".join(parts.get(each, each) for each in differing) if command == own else f"`syncrelay {command}`"
    return (
        f"{folder}: holds results of {what}: name another folder, or replace them with --overwrite"
        f"\n  found    {theirs}\n  expected {ours}"
    )


def _clear(scratch: Path) -> None:
    try:
        if scratch.exists():
            shutil.rmtree(scratch)
        scratch.mkdir()
    except OSError as error:
        raise cannot_be_written(scratch, error) from error


def _put_in_place(finished: Path, place: Path) -> None:
    """Rename a finished result to its name; one that is there makes room first, and goes last."""
    former = finished.with_suffix(".former")
    if os.path.lexists(place):
        place.rename(former)
    finished.rename(place)
    sync_folder(place.parent)
    shutil.rmtree(former, ignore_errors=True)
