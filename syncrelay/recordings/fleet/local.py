"""This machine's cores: a forked process for each recording, so many at a time.

Modules are imported before, once. A process ends with its recording: its memory is free then, and what breaks it, such
as the kernel when memory runs out, breaks nothing else.
"""

import os
import pickle
import resource
import select
import signal
import warnings
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NoReturn

from syncrelay.recordings.bag.definitions import jazzy_definition
from syncrelay.recordings.fleet.engine import TICK_S, TRIES, Finished, given_up, took_too_long
from syncrelay.recordings.fleet.work import Failed, Job, Outcome, end_with_parent, perform

LEAST_MEMORY: Final = 1_000_000_000
"""What a worker may take in bytes, however many work at a time."""


@dataclass(frozen=True, slots=True)
class _Worker:
    """A process at work on a job, for the nth time, and the file in memory that it writes the outcome into."""

    job: Job
    attempt: int
    pid: int
    told: int


class LocalEngine:
    """Forks a process for each job; see Engine. For a process that has started no thread of its own."""

    def __init__(self, *, jobs: int, memory: int | None = None) -> None:
        """Work on so many jobs at a time, each of which may take so many bytes: its share of the machine's."""
        self._jobs = jobs
        self._memory = max(LEAST_MEMORY, machine_memory() // jobs) if memory is None else memory

    def run(self, jobs: Iterable[Job | None]) -> Generator[Finished | None, None, None]:
        """See Engine."""
        # ROS types are loaded at their first use, which takes longer than a short recording: here, once for all.
        jazzy_definition("std_msgs/msg/Header")
        waiting = iter(jobs)
        running: dict[int, _Worker] = {}
        ended = select.poll()

        def begin(job: Job, attempt: int) -> None:
            worker = self._fork(job, attempt)
            number = os.pidfd_open(worker.pid)
            running[number] = worker
            ended.register(number, select.POLLIN)

        try:
            while True:
                while len(running) < self._jobs and (job := next(waiting, None)) is not None:
                    begin(job, 1)
                if not running:
                    return
                found = ended.poll(TICK_S * 1000)
                for number, _ in found:
                    ended.unregister(number)
                    worker = running.pop(number)
                    os.close(number)
                    outcome = _outcome(worker)
                    if outcome is None and worker.attempt < TRIES:
                        begin(worker.job, worker.attempt + 1)
                    else:
                        yield Finished(worker.job, outcome or Failed(given_up(worker.job, "its worker was killed")))
                if not found:
                    yield None
        finally:
            for worker in running.values():
                os.kill(worker.pid, signal.SIGKILL)
            for number, worker in running.items():
                os.waitpid(worker.pid, 0)
                os.close(worker.told)
                os.close(number)

    def _fork(self, job: Job, attempt: int) -> _Worker:
        told = os.memfd_create("syncrelay-outcome")
        parent = os.getpid()
        with warnings.catch_warnings():
            # Of threads: those of numpy and pyarrow are idle, and made anew.
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
        if not pid:
            _work(job, parent, told, self._memory)
        return _Worker(job, attempt, pid, told)


def machine_memory() -> int:
    """Return the bytes of memory that this machine, or the container that we are in, may use."""
    whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    try:
        limit = Path("/sys/fs/cgroup/memory.max").read_text()
    except OSError:
        return whole
    return min(whole, int(limit)) if limit.strip().isdigit() else whole


def _work(job: Job, parent: int, told: int, memory: int) -> NoReturn:
    """Do a job in a process that has just been forked, and end it without what the parent does as it ends."""
    code = 1
    try:
        # Ctrl-C comes from the terminal to all of us: what it means, the parent says.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        for number in (signal.SIGTERM, signal.SIGALRM):
            signal.signal(number, signal.SIG_DFL)
        end_with_parent()
        if os.getppid() == parent:
            resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
            with os.fdopen(told, "wb") as file:
                pickle.dump(perform(job), file)
            code = 0
    finally:
        os._exit(code)


def _outcome(worker: _Worker) -> Outcome | None:
    """Return what a process that has ended told or why it was ended, None if it died."""
    _, status = os.waitpid(worker.pid, 0)
    with os.fdopen(worker.told, "rb") as file:
        if status == 0:
            file.seek(0)
            outcome: Outcome = pickle.load(file)  # noqa: S301  written by a process of ours
            return outcome
    worker.job.remove_scratch()
    return Failed(took_too_long(worker.job)) if os.WTERMSIG(status) == signal.SIGALRM else None
