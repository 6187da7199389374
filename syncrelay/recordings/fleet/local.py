"""An engine on this machine's cores: a forked process for each recording, as many at a time as there are jobs.

All modules are imported before the fork. A process ends with its recording: that frees its memory, and if the kernel
kills it because memory runs out, the other recordings are not affected.
"""

import os
import resource
import signal
from collections.abc import Generator, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from pathlib import Path
from typing import Final

from syncrelay.recordings.bag.definitions import jazzy_definition
from syncrelay.recordings.fleet.job import TICK_S, TRIES, Failed, Finished, Job, Outcome, given_up, took_too_long
from syncrelay.recordings.fleet.work import perform
from syncrelay.recordings.forks import fork

LEAST_MEMORY: Final = 1_000_000_000
"""What a worker may take in bytes, however many work at a time."""

_STOPS: Final = frozenset({signal.SIGINT, signal.SIGTERM})


@dataclass(frozen=True, slots=True)
class _Worker:
    """A process that tries a job for the nth time, and what its outcome is read from."""

    job: Job
    attempt: int
    process: ForkProcess
    outcome: Connection


class LocalEngine:
    """Forks a process for each job, see Engine. Only for a process that has started no thread of its own."""

    def __init__(self, *, jobs: int, memory: int | None = None) -> None:
        """Work on so many jobs at a time. Each may take so many bytes, by default its share of the machine's memory."""
        self._jobs = jobs
        self._memory = max(LEAST_MEMORY, machine_memory() // jobs) if memory is None else memory

    def run(self, jobs: Iterable[Job]) -> Generator[Finished | None, None, None]:
        """See Engine."""
        # ROS types are loaded at their first use, which takes longer than a short recording: once here, for all.
        jazzy_definition("std_msgs/msg/Header")
        waiting = iter(jobs)
        running: dict[object, _Worker] = {}

        def begin(job: Job, attempt: int) -> None:
            # A signal between the fork and the entry in `running` would leave a worker that nobody ends.
            former = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPS)
            try:
                worker = self._fork(job, attempt)
                running[worker.outcome] = worker
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, former)

        try:
            while True:
                while len(running) < self._jobs and (job := next(waiting, None)) is not None:
                    begin(job, 1)
                if not running:
                    return
                ended = wait([worker.outcome for worker in running.values()], TICK_S)
                for ending in ended:
                    worker = running.pop(ending)
                    outcome = _outcome(worker)
                    if outcome is None and worker.attempt < TRIES:
                        begin(worker.job, worker.attempt + 1)
                    else:
                        yield Finished(worker.job, outcome or Failed(given_up(worker.job, "its worker was killed")))
                if not ended:
                    yield None
        finally:
            for worker in running.values():
                worker.process.kill()
            for worker in running.values():
                worker.process.join()

    def _fork(self, job: Job, attempt: int) -> _Worker:
        return _Worker(job, attempt, *fork(partial(_work, job, self._memory)))


def machine_memory() -> int:
    """Return the bytes of memory of this machine, or of the container that this process runs in."""
    whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    try:
        limit = Path("/sys/fs/cgroup/memory.max").read_text()
    except OSError:
        return whole
    return min(whole, int(limit)) if limit.strip().isdigit() else whole


def _work(job: Job, memory: int, outcome: Connection) -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    outcome.send(perform(job))


def _outcome(worker: _Worker) -> Outcome | None:
    """Return the outcome of a process that has one or has ended; None if it died."""
    found: Outcome | None = None
    with worker.outcome, suppress(EOFError, OSError):
        found = worker.outcome.recv()
    worker.process.join()
    if found is None:
        worker.job.remove_scratch()
        return Failed(took_too_long(worker.job)) if worker.process.exitcode == -signal.SIGALRM else None
    return found
