"""What a worker does with one recording, on this machine or on another."""

import shutil
import signal
import socket
import traceback
from errno import EROFS
from pathlib import Path
from typing import Final

from syncrelay import own_version
from syncrelay.errors import NO_SPACE, BagError, OutputError, SyncRelayError
from syncrelay.recordings.fleet.content import Content, are_intact, content_of, flush, marks_of, results_in
from syncrelay.recordings.fleet.job import Done, Failed, Job, Kept, Outcome
from syncrelay.recordings.fleet.ledger import LEDGER, Entry

_NS_PER_SECOND: Final = 1_000_000_000


def perform(job: Job) -> Outcome:
    """Do a job. Whatever goes wrong is its outcome.

    If it takes too long, the kernel ends this process by SIGALRM, whatever code is running then.
    """
    _end_after(job.limit_of(job.size))
    try:
        return _performed(job)
    finally:
        _end_after(0)


def _end_after(duration: int) -> None:
    """Let SIGALRM end this process after so many nanoseconds; 0 takes that back."""
    signal.setitimer(signal.ITIMER_REAL, duration / _NS_PER_SECOND)


def _performed(job: Job) -> Outcome:
    if (why := _why_unfit(job)) is not None:
        return Failed(why, ends_all=True)
    folder, content = job.scratch_folder(), ""
    try:
        found = content_of(job.source.place)
        content = found.hash
        # The size of what is behind a URL is known only now.
        _end_after(job.limit_of(found.size))
        if job.done is not None and job.done.content == content and _is_there(job, job.done):
            return Kept()
        return _done(job, found, folder)
    except SyncRelayError as error:
        failed = Failed(str(error), content, ends_all=isinstance(error, OutputError))
    except MemoryError:
        failed = Failed(f"{job.source.shown}: takes more memory than a worker has: use fewer --jobs", content)
    except Exception as error:  # noqa: BLE001  a bug with one recording must not stop the others
        if isinstance(error, OSError) and error.errno in (*NO_SPACE, EROFS):
            failed = Failed(f"{job.into}: cannot be written: {error.strerror}", content, ends_all=True)
        else:
            failed = Failed(traceback.format_exc(), content, is_bug=True)
    shutil.rmtree(folder, ignore_errors=True)
    return failed


def _done(job: Job, content: Content, folder: Path) -> Done:
    folder.mkdir(parents=True)
    facts = job.task.run(job.source, folder)
    if marks_of(job.source.place) != content.marks:
        raise BagError(f"{job.source.shown}: was changed while it was read: is it still being recorded?")
    for path in (*folder.rglob("*"), folder):
        flush(path)
    files = results_in(folder)
    if job.store is not None:
        job.store.put(job.source.name, folder)
        shutil.rmtree(folder)
    return Done(content, facts, files, folder)


def _is_there(job: Job, done: Entry) -> bool:
    name = job.source.name
    return are_intact(job.into / name, done.files) if job.store is None else job.store.has(name, done.files)


def _why_unfit(job: Job) -> str | None:
    """Return why this machine cannot do any job of the command, which may run on another one."""
    if own_version() != job.version:
        return f"{socket.gethostname()} has syncrelay {own_version()}, expected {job.version}: install the same version"
    if job.store is None and not (job.into / LEDGER).exists():
        return f"{job.into}: is not seen from {socket.gethostname()}: name a folder that all machines share"
    return None
