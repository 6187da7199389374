"""A command on many recordings: its progress, its end, its exit code."""

import os
import signal
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, Final, Self, TypeAlias

from syncrelay.cli.boundary import AT_FAULT, DONE, OUR_BUG, put, remark, say
from syncrelay.cli.stop import TERMINATED
from syncrelay.config.wording import counted
from syncrelay.errors import SyncRelayError
from syncrelay.printable import printable
from syncrelay.recordings.fleet.engine import Engine, Finished
from syncrelay.recordings.fleet.facts import FleetRow
from syncrelay.recordings.fleet.local import LocalEngine
from syncrelay.recordings.fleet.progress import Progress
from syncrelay.recordings.fleet.recordings import find_sources
from syncrelay.recordings.fleet.robots import RobotPattern
from syncrelay.recordings.fleet.run import Others, Run
from syncrelay.recordings.fleet.task import NOTES, PROBLEMS, Source, Task
from syncrelay.recordings.fleet.work import Failed, Job

_EVERY_S: Final = 10.0
_CLEARED: Final = "\r\033[K"

Finish: TypeAlias = Callable[[Run, Sequence[Source]], int]
"""What is done with the results of all recordings, named in their order; returns an exit code."""


def do_on_many(
    task: Task,
    words: Sequence[str],
    arguments: Namespace,
    *,
    finish: Finish | None = None,
) -> int:
    """Do a task on all recordings that words name, into a folder, as the options of add_fleet_options say.

    `finish` is called once nothing is left to do, while the folder is still
    held; what it prints is the outcome, else a line is.
    Returns the exit code: 1 where a recording is at fault. Raises SyncRelayError where a word names no recording, or
    the folder cannot be used; with --strict also for the first recording that is at fault.
    """
    into = Path(os.path.abspath(arguments.into))  # noqa: PTH100  what a user named as a link stays one
    with _Stop() as stop:
        sources = find_sources(words, into=into)
        others = Others.REPLACED if arguments.overwrite else Others.REFUSED
        with Run(task, sources, into=into, others=others, time_limit=arguments.time_limit) as run:
            if run.unreadable:
                lines = counted(run.unreadable, "line")
                remark(f"{into}: {lines} of its ledger cannot be read; what was told there is done again")
            shown = _Shown(Progress(run.jobs, time.monotonic()))
            code = DONE
            with closing(run.go(_engine(arguments))) as finished, shown.clearing():
                for each in finished:
                    if each is not None:
                        code = max(code, _tell(each, run, shown))
                        if code and arguments.strict:
                            raise SyncRelayError(f"ended at the first recording that is at fault: {shown.left()}")
                    shown.show()
                    if stop.asked is not None:
                        break
            summary = printable(f"{arguments.into}: {shown.left()}")
            if finish is not None and stop.asked is None:
                say(summary)
                code = max(code, finish(run, sources))
        if stop.asked is not None:
            remark(f"ended by {stop.asked.name}: {shown.left()}; the same command does the rest")
            if stop.asked is signal.SIGINT:
                raise KeyboardInterrupt
            return TERMINATED
    if finish is None:
        put(summary)
    return code


def put_facts(folder: Path, pattern: RobotPattern | None, *, is_json: bool) -> int:
    """Write the table of facts of a folder's results, and print a summary of it, or its rows as lines of JSON; 0."""
    from syncrelay.recordings.fleet.summary import Summary
    from syncrelay.recordings.fleet.table import TABLE, fleet_rows, write_rows

    summary = Summary()

    def rows() -> Iterator[FleetRow]:
        for row in fleet_rows(folder, pattern):
            summary.take(row)
            if is_json:
                put(row.model_dump_json())
            yield row

    write_rows(folder / TABLE, rows(), FleetRow)
    for line in () if is_json else summary.lines():
        put(line)
    remark(f"wrote {folder / TABLE}: {counted(summary.rows, 'row')}; docs/howto/fleet_report.md has ten queries")
    return DONE


def _engine(arguments: Namespace) -> Engine:
    """Return what options say that works on recordings. Raises SyncRelayError where it is not installed."""
    jobs = arguments.jobs or len(os.sched_getaffinity(0))
    if arguments.engine == "local":
        return LocalEngine(jobs=jobs)
    from syncrelay.recordings.fleet.on_ray import RayEngine

    return RayEngine(jobs=jobs)


def _tell(finished: Finished, run: Run, shown: "_Shown") -> int:
    """Say what is wrong with a recording, and return the exit code for it."""
    job, outcome = finished
    shown.progress.take(finished)
    if isinstance(outcome, Failed):
        shown.clear()
        if outcome.is_bug:
            say(outcome.why)
            remark(f"this is a bug in syncrelay; it happened with the recording {job.source.shown[0]}")
            return OUR_BUG
        remark(outcome.why)
        if outcome.ends_all:
            raise SyncRelayError(f"ended: {shown.left()}")
        return AT_FAULT
    problems = _told(run, job, PROBLEMS)
    shown.faulty += bool(problems)
    for sentence in [*problems, *_told(run, job, NOTES)]:
        shown.clear()
        name = job.source.shown[0]
        # What is wrong with a file of it is said with the file's name.
        remark(sentence if sentence.startswith(name) else f"{name}: {sentence}")
    return AT_FAULT if problems else DONE


def _told(run: Run, job: Job, fact: str) -> list[str]:
    entry = run.entry(job)
    found = entry.facts.get(fact) if entry is not None else None
    return [str(each) for each in found] if isinstance(found, list) else []


@dataclass(slots=True)
class _Shown:
    """Progress on stderr: one line that is written anew on a terminal, elsewhere a line now and then."""

    progress: Progress
    faulty: int = 0
    """How many recordings were done though something is wrong with them."""
    _last: float = 0.0
    _is_drawn: bool = False

    def __post_init__(self) -> None:
        self._last = self.progress.begun

    def show(self) -> None:
        now = time.monotonic()
        if sys.stderr.isatty():
            sys.stderr.write(_CLEARED + self.progress.line(now))
            sys.stderr.flush()
            self._is_drawn = True
        elif now - self._last >= _EVERY_S:
            remark(self.progress.line(now))
            self._last = now

    def clear(self) -> None:
        if self._is_drawn:
            sys.stderr.write(_CLEARED)
            self._is_drawn = False

    @contextmanager
    def clearing(self) -> Iterator[None]:
        """Leave no line behind, however this ends."""
        try:
            yield
        finally:
            self.clear()

    def left(self) -> str:
        """Return what came of the recordings."""
        progress = self.progress
        missing = len(progress.jobs) - progress.done - progress.kept - progress.failed
        counts = {"done": progress.done, "done before": progress.kept, "failed": progress.failed, "not done": missing}
        told = ", ".join(f"{count} {what}" for what, count in counts.items() if count)
        faulty = f"; {self.faulty} with problems" if self.faulty else ""
        return f"{counted(len(progress.jobs), 'recording')}: {told}{faulty}"


class _Stop:
    """SIGINT and SIGTERM ask for an end in order; a second one ends the process at once, and its workers with it."""

    def __init__(self) -> None:
        self.asked: signal.Signals | None = None
        self._former: dict[int, Any] = {}

    def __enter__(self) -> Self:
        for number in (signal.SIGINT, signal.SIGTERM):
            # A shell that starts us in the background has us ignore Ctrl-C.
            if signal.getsignal(number) is not signal.SIG_IGN:
                self._former[number] = signal.signal(number, self._ask)
        return self

    def __exit__(self, *_error: object) -> None:
        for number, former in self._former.items():
            signal.signal(number, former)

    def _ask(self, number: int, _frame: FrameType | None) -> None:
        self.asked = signal.Signals(number)
        for each in self._former:
            signal.signal(each, signal.SIG_DFL)
