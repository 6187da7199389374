"""Pieces of work side by side, each in a process of its own, that print as if done one after another.

Processes are forked: what is imported is there at once, and what a piece of work breaks is its own. So this is for
commands that have started no thread. When a process ends, its memory is free.
"""

import os
import signal
import sys
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import FrameType
from typing import Final, NoReturn

from syncrelay.cli.boundary import AT_FAULT, DONE, INTERRUPTED, OUR_BUG, guarded, pass_on, remark

# Of prctl(2): the signal that the kernel sends when the parent ends, however it ends.
_PR_SET_PDEATHSIG: Final = 1


@dataclass(frozen=True, slots=True)
class Work:
    """What is done for one file: its name, and what prints and returns an exit code."""

    name: str
    do: Callable[[], int]


@dataclass(slots=True)
class _Worker:
    """A process, and the files in memory that it prints into."""

    work: Work
    pid: int
    out: int
    err: int


def side_by_side(works: Sequence[Work], *, jobs: int) -> int:
    """Do all of the work, so many at a time, and print what each prints in its turn; the greatest exit code.

    A process that dies is that file's fault, and the others go on. When this is interrupted, all end.
    """
    waiting = list(reversed(works))
    running: dict[int, _Worker] = {}
    ended: dict[int, int] = {}
    turns = deque[_Worker]()
    code = DONE
    try:
        while waiting or turns:
            while waiting and len(running) < jobs:
                worker = _begin(waiting.pop())
                running[worker.pid] = worker
                turns.append(worker)
            pid, status = os.wait()
            running.pop(pid)
            ended[pid] = os.waitstatus_to_exitcode(status)
            while turns and turns[0].pid in ended:
                worker = turns.popleft()
                code = max(code, _tell(worker, ended.pop(worker.pid)))
    finally:
        for pid in running:
            os.kill(pid, signal.SIGINT)
        for pid in running:
            os.waitpid(pid, 0)
    return code


def _begin(work: Work) -> _Worker:
    out, err = (os.memfd_create(f"syncrelay-{name}") for name in ("out", "err"))
    sys.stdout.flush()
    sys.stderr.flush()
    parent = os.getpid()
    with warnings.catch_warnings():
        # Of threads: numpy's own are idle, and made anew.
        warnings.simplefilter("ignore", DeprecationWarning)
        pid = os.fork()
    if not pid:
        _work(work, parent, out, err)
    return _Worker(work, pid, out, err)


def _work(work: Work, parent: int, out: int, err: int) -> NoReturn:
    """Do a piece of work in a process that has just been forked, and end it without what the parent does as it ends."""
    code = OUR_BUG
    try:
        signal.signal(signal.SIGINT, _interrupt_once)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        _end_with(parent)
        os.dup2(out, 1)
        os.dup2(err, 2)
        code = guarded(work.do)
    finally:
        os._exit(code)


def _interrupt_once(_number: int, _frame: FrameType | None) -> None:
    """Interrupt what is done, and not what it then clears away: Ctrl-C comes from the terminal, and from the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise KeyboardInterrupt


def _end_with(parent: int) -> None:
    import ctypes

    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGINT)
    if os.getppid() != parent:
        os._exit(INTERRUPTED)


def _tell(worker: _Worker, code: int) -> int:
    """Print what a process printed, and say what ended it if a signal did; return its exit code."""
    pass_on(_content(worker.out), _content(worker.err))
    if code < 0:
        why = f"the process that read it was ended by {signal.Signals(-code).name}"
        remark(f"{worker.work.name}: {why}; check whether there is enough memory, or use fewer --jobs")
        return AT_FAULT
    if code == OUR_BUG:
        remark(f"it happened with the recording {worker.work.name}")
    return code


def _content(file: int) -> bytes:
    with os.fdopen(file, "rb") as content:
        content.seek(0)
        return content.read()
