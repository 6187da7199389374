"""A run: which recordings are to be done, results put in place, and their entries in the ledger."""

import os
import shutil
from collections.abc import Generator, Sequence
from contextlib import closing
from enum import Enum
from pathlib import Path
from typing import Final, Self

from syncrelay import own_version
from syncrelay.errors import SyncRelayError
from syncrelay.output_files import cannot_be_written, remove_leftovers
from syncrelay.recordings.fleet.content import flush, size_of
from syncrelay.recordings.fleet.job import SCRATCH, Done, Engine, Failed, Finished, Job
from syncrelay.recordings.fleet.ledger import Entry, Ledger, State
from syncrelay.recordings.fleet.store import ResultStore
from syncrelay.recordings.fleet.task import Source, Task
from syncrelay.urls import redacted


class Others(Enum):
    """What happens to results in the folder that another file, version or option of a command gave."""

    REFUSED = "refused"
    REPLACED = "replaced"


class Run:
    """A task on recordings, into a folder that only this process writes to; a context manager."""

    def __init__(
        self,
        task: Task,
        sources: Sequence[Source],
        *,
        into: Path,
        others: Others,
        time_limit: int | None = None,
        store: ResultStore | None = None,
    ) -> None:
        """Open the folder and remove what a killed run left in it. `time_limit` and `store` are those of each Job.

        Raises SyncRelayError if the folder cannot be used, or holds other results that are not to be replaced.
        """
        self._fingerprint = task.fingerprint
        self._store = store
        if store is not None:
            store.fetch_ledger(into)
        self._ledger = Ledger(into)
        self.unreadable = self._ledger.unreadable
        """How many lines of the ledger could not be read; these recordings are done again."""
        try:
            self._take_over({source.name for source in sources}, others)
            _clear(into / SCRATCH)
            remove_leftovers(into)
        except BaseException:
            self._ledger.__exit__(None, None, None)
            raise
        version, jobs = own_version(), []
        for source in sources:
            entry = self._ledger.entries.get(source.name)
            done = entry if entry is not None and self._is_ours(entry) else None
            jobs.append(Job(source, task, into, done, size_of(source.place), version, time_limit, store))
        # The largest first, so that none of them is begun when all others are done.
        self.jobs: Final = tuple(sorted(jobs, key=lambda job: -job.size))
        """All recordings, in the order in which they are begun."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        shutil.rmtree(self._ledger.folder / SCRATCH, ignore_errors=True)
        self._ledger.__exit__(None, None, None)
        if self._store is not None:
            self._store.save_ledger(self._ledger.folder, is_last=True)

    def go(self, engine: Engine) -> Generator[Finished | None, None, None]:
        """Yield each recording once its result is in place and in the ledger, and None as the engine does.

        Closing it ends all workers.
        """
        with closing(engine.run(self.jobs)) as finished:
            for each in finished:
                if each is not None:
                    self._take(each)
                yield each

    def entries(self) -> list[Entry]:
        """Return the last entry of each recording that the folder has, sorted by name."""
        return [entry for _, entry in sorted(self._ledger.entries.items())]

    def entry(self, job: Job) -> Entry | None:
        """Return the ledger's entry for a job, with PROBLEMS and NOTES as its only facts."""
        return self._ledger.entries.get(job.source.name)

    def _is_ours(self, entry: Entry) -> bool:
        return entry.state is State.DONE and entry.fingerprint == self._fingerprint

    def _take(self, finished: Finished) -> None:
        source, outcome = finished.job.source, finished.outcome
        if isinstance(outcome, Done):
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
            if self._store is None:
                _put_in_place(outcome.folder, self._ledger.folder / source.name)
            else:
                self._store.save_ledger(self._ledger.folder, is_last=False)
        elif isinstance(outcome, Failed) and not outcome.ends_all and (outcome.content or finished.job.done is None):
            # A recording that cannot be reached now (it has no content) keeps the result that it has. Otherwise the
            # former result would pass for one of what the recording is now.
            self._remove(source.name)
            key = (source.name, State.FAILED, source.shown, self._fingerprint, outcome.content)
            entry = Entry(*key, error=outcome.why)
            if self._ledger.entries.get(source.name) != entry:
                self._ledger.append(entry)

    def _take_over(self, names: set[str], others: Others) -> None:
        """Refuse results that another command gave, or remove those that this command will not replace."""
        entries = self._ledger.entries.values()
        foreign = [entry for entry in entries if entry.state is State.DONE and not self._is_ours(entry)]
        if foreign and others is Others.REFUSED:
            place = str(self._ledger.folder) if self._store is None else redacted(self._store.url)
            raise SyncRelayError(_refusal(place, foreign[0].fingerprint, self._fingerprint))
        for entry in foreign:
            if entry.name not in names:
                self._ledger.append(Entry(entry.name, State.REMOVED, entry.recording, entry.fingerprint))
                self._remove(entry.name)

    def _remove(self, name: str) -> None:
        if self._store is None:
            shutil.rmtree(self._ledger.folder / name, ignore_errors=True)
        else:
            self._store.remove(name)


def _refusal(folder: str, theirs: str, ours: str) -> str:
    """Return what is different about the results in a folder, from two lines of fingerprint_of."""
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
    """Rename a finished result to its name. A former one is moved out of the way first, and removed last."""
    former = finished.with_suffix(".former")
    if os.path.lexists(place):
        place.rename(former)
    finished.rename(place)
    flush(place.parent)
    shutil.rmtree(former, ignore_errors=True)
