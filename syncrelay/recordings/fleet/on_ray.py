"""An engine on a Ray cluster: the one at RAY_ADDRESS, or one that is started here and ends with the command.

A recording is a Ray task. Ray places it, and begins it again if a worker or a whole node is lost.
"""

import os
import signal
import socket
import sys
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager, redirect_stdout
from types import FrameType
from typing import Any, Final

from syncrelay.errors import SyncRelayError
from syncrelay.recordings.fleet.job import TICK_S, TRIES, Failed, Finished, Job, Outcome, given_up
from syncrelay.recordings.fleet.work import perform
from syncrelay.recordings.forks import end_with_parent

MEMORY: Final = 1_000_000_000
"""What each task declares to take, in bytes: Ray begins no more tasks on a node than fit."""

ADDRESS: Final = "RAY_ADDRESS"

_PATIENCE_S: Final = 10

# Tasks for each core: one that is done finds the next one waiting.
_AHEAD: Final = 2


class _HeldSignals:
    """Remembers SIGINT and SIGTERM: Ray may lose an exception that a handler raises inside of its native code.

    A second signal ends the process at once.
    """

    def __init__(self) -> None:
        self._former = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        self._came = 0

    def hold(self) -> None:
        """Install the handlers; once more after ray.init, which installs its own."""
        for number, former in self._former.items():
            # A shell that starts us in the background has Ctrl-C ignored.
            if former is not signal.SIG_IGN and not self._came:
                signal.signal(number, self._remember)

    def release(self) -> None:
        """Restore the former handlers."""
        for number, former in self._former.items():
            signal.signal(number, former)

    def pass_on(self) -> None:
        """Give a signal that has come to its former handler, which raises what ends the command."""
        if self._came:
            self.release()
            signal.raise_signal(self._came)

    def _remember(self, number: int, _frame: FrameType | None) -> None:
        self._came = number
        for each in self._former:
            signal.signal(each, signal.SIG_DFL)


class RayEngine:
    """Has a Ray cluster do jobs; see Engine."""

    def __init__(self, *, jobs: int) -> None:
        """Import Ray. When run() begins, it connects to a cluster, or starts one of so many cores."""
        import ray  # noqa: PLC0415  of the extra `fleet`, and takes half a second

        self._ray: Any = ray
        self._jobs = jobs

    def run(self, jobs: Iterable[Job]) -> Generator[Finished | None, None, None]:
        """See Engine. Raises SyncRelayError if the cluster cannot be reached."""
        ray = self._ray
        waiting = iter(jobs)
        with self._connected() as signals:
            task = ray.remote(num_cpus=1, memory=MEMORY, max_retries=TRIES - 1)(_perform)
            running: dict[Any, Job] = {}
            try:
                while True:
                    signals.pass_on()
                    # Nodes come and go, and each task that is handed over takes memory here.
                    cores = int(ray.cluster_resources().get("CPU", 0))
                    room = max(1, _AHEAD * cores) - len(running)
                    while room > 0 and (job := next(waiting, None)) is not None:
                        running[task.remote(job)] = job
                        room -= 1
                    if not running:
                        return
                    ready, _ = ray.wait(list(running), timeout=TICK_S)
                    for reference in ready:
                        yield self._finished(reference, running.pop(reference))
                    if not ready:
                        yield None
            finally:
                for reference in running:
                    ray.cancel(reference, force=True)

    def _finished(self, reference: Any, job: Job) -> Finished:
        try:
            return Finished(job, self._ray.get(reference))
        except self._ray.exceptions.RayTaskError as error:
            return Finished(job, Failed(str(error), is_bug=True))
        except self._ray.exceptions.RayError as error:
            job.remove_scratch()
            # Ray does not say what ended it.
            why = f"its worker was lost ({type(error).__name__}), or took longer than --time-limit,"
            return Finished(job, Failed(given_up(job, why)))

    @contextmanager
    def _connected(self) -> Iterator[_HeldSignals]:
        ray, signals = self._ray, _HeldSignals()
        # No usage statistics leave the machine, and no port is opened for a dashboard that nobody asked for.
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        options: dict[str, Any] = {"log_to_driver": False, "configure_logging": False}
        address = os.environ.get(ADDRESS)
        if not address:
            options |= {"num_cpus": self._jobs, "include_dashboard": False}
        try:
            if address:
                _require_listener(address)
            signals.hold()
            ray.init(address=address or "local", **options)
            signals.hold()
        except (ConnectionError, OSError, RuntimeError, ValueError) as error:
            signals.release()
            where = f"the Ray cluster {address} of {ADDRESS} cannot be reached" if address else "Ray cannot be started"
            raise SyncRelayError(f"{where}: {error}") from error
        # Ray prints to stdout what happens to workers; stdout is for data.
        with redirect_stdout(sys.stderr):
            try:
                yield signals
            finally:
                ray.shutdown()
                signals.release()


def _perform(job: Job) -> Outcome:
    """Do a job in a Ray worker, which is killed with its node: a command that is killed leaves no worker behind."""
    end_with_parent()
    return perform(job)


def _require_listener(address: str) -> None:
    """Raise OSError if nobody listens: Ray itself would try for minutes, and ignore signals meanwhile."""
    host, _, port = address.rpartition("://")[2].rpartition(":")
    if host and port.isdigit():
        socket.create_connection((host.strip("[]"), int(port)), timeout=_PATIENCE_S).close()
