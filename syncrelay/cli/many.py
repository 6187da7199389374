"""A command on many recordings: its progress, its end, its exit code."""

import os
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, TypeAlias

from syncrelay.cli.boundary import AT_FAULT, DONE, OUR_BUG, put, remark, say
from syncrelay.cli.stop import Terminated
from syncrelay.config.wording import counted
from syncrelay.errors import SyncRelayError
from syncrelay.output_files import local_path
from syncrelay.printable import printable
from syncrelay.recordings.fleet.job import Engine, Failed, Finished
from syncrelay.recordings.fleet.local import LocalEngine
from syncrelay.recordings.fleet.progress import Progress
from syncrelay.recordings.fleet.recordings import find_sources
from syncrelay.recordings.fleet.run import Others, Run
from syncrelay.recordings.fleet.store import ResultStore
from syncrelay.recordings.fleet.task import NOTES, PROBLEMS, Source, Task
from syncrelay.urls import redacted

_EVERY_S: Final = 10.0
_CLEARED: Final = "\r\033[K"

Finish: TypeAlias = Callable[[Run, Sequence[Source]], int]
"""What is done with the results of all recordings, named in their order; returns an exit code."""


def do_on_many(task: Task, words: Sequence[str], arguments: Namespace, *, finish: Finish | None = None) -> int:
    """Do a task on all recordings that words name, into a folder, as the options of add_many_options say.

    `finish` is called when nothing is left to do, while the folder is still locked. What it prints takes the place of
    the summary on stdout. Returns the exit code: 1 if a recording is at fault. Raises SyncRelayError if a word names no
    recording, or the folder cannot be used; with --strict also for the first recording that is at fault.
    """
    path, named = local_path(arguments.into), redacted(arguments.into)
    with ExitStack() as opened:
        store = None if path is not None else ResultStore(arguments.into.rstrip("/"))
        if path is None:
            path = Path(opened.enter_context(TemporaryDirectory(prefix="syncrelay-")))
        into = Path(os.path.abspath(path))  # noqa: PTH100  a link keeps its name
        sources = find_sources(words, into=into if store is None else store.url)
        others = Others.REPLACED if arguments.overwrite else Others.REFUSED
        run = opened.enter_context(
            Run(task, sources, into=into, others=others, time_limit=arguments.time_limit, store=store)
        )
        if run.unreadable:
            lines = counted(run.unreadable, "line")
            remark(f"{named}: {lines} of its ledger cannot be read: what no other line has is done again")
        progress = Progress(run.jobs, time.monotonic())
        try:
            code = _go(run, progress, arguments)
            summary = printable(f"{named}: {progress.summary()}")
            if finish is None:
                put(summary)
                return code
            say(summary)
            return max(code, finish(run, sources))
        except (KeyboardInterrupt, Terminated) as ended:
            name = "SIGTERM" if isinstance(ended, Terminated) else "SIGINT"
            remark(f"ended by {name}: {progress.summary()}; the same command does the rest")
            raise


def _go(run: Run, progress: Progress, arguments: Namespace) -> int:
    """Do all jobs of a run, with progress on stderr: on a terminal in one line, elsewhere a line every 10 s."""
    code, last, is_terminal = DONE, progress.begun, sys.stderr.isatty()
    clear = _CLEARED if is_terminal else ""
    try:
        with closing(run.go(_engine(arguments))) as finished:
            for each in finished:
                if each is not None:
                    sys.stderr.write(clear)
                    code = max(code, _take(each, run, progress))
                    if code and arguments.strict:
                        raise SyncRelayError(f"ended at the first recording that is at fault: {progress.summary()}")
                now = time.monotonic()
                if is_terminal:
                    sys.stderr.write(_CLEARED + progress.line(now))
                    sys.stderr.flush()
                elif now - last >= _EVERY_S:
                    remark(progress.line(now))
                    last = now
    finally:
        sys.stderr.write(clear)
    return code


def _engine(arguments: Namespace) -> Engine:
    """Return what works on the recordings. Raises SyncRelayError if it is not installed."""
    jobs = arguments.jobs or len(os.sched_getaffinity(0))
    if arguments.engine == "local":
        return LocalEngine(jobs=jobs)
    from syncrelay.recordings.fleet.on_ray import RayEngine

    return RayEngine(jobs=jobs)


def _take(finished: Finished, run: Run, progress: Progress) -> int:
    """Count a recording that has ended, say what is wrong with it, and return the exit code for it."""
    job, outcome = finished
    progress.take(finished)
    name = job.source.shown
    if isinstance(outcome, Failed):
        if outcome.is_bug:
            say(outcome.why)
            remark(f"this is a bug in syncrelay; it happened with the recording {name}")
            return OUR_BUG
        remark(outcome.why)
        if outcome.ends_all:
            raise SyncRelayError(f"ended: {progress.summary()}")
        return AT_FAULT
    entry = run.entry(job)
    facts = entry.facts if entry is not None else {}
    problems = facts.get(PROBLEMS, [])
    progress.faulty += bool(problems)
    for sentence in map(str, [*problems, *facts.get(NOTES, [])]):
        # A sentence about one of its files begins with the file's name.
        remark(sentence if sentence.startswith(name) else f"{name}: {sentence}")
    return AT_FAULT if problems else DONE
