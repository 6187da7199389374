"""Work done side by side, each piece in a process of its own, with output as if done one after another.

The processes are forked: imports are there at once, and a crash stays in its process. Only commands that have started
no thread can do this. The end of a process frees its memory.
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

# Of prctl(2): which signal the kernel sends when the parent ends, in whatever way.
_PR_SET_PDEATHSIG: Final = 1


@dataclass(frozen=True, slots=True)
class Work:
    """The work on one file: the file's name, and a function that prints and returns an exit code."""

    name: str
    do: Callable[[], int]


@dataclass(slots=True)
class _Worker:
    """A process, and the files in memory that hold its output."""

    work: Work
    pid: int
    out: int
    err: int


def side_by_side(works: Sequence[Work], *, jobs: int) -> int:
    """Do all of the work with so many processes, print each output in its turn, and return the greatest exit code.

    If a process dies, that counts as a fault of its file and the others continue. An interrupt ends all of them.
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
        # Python warns of forking with threads. Those are numpy's: they are idle, and numpy starts its own in the fork.
        warnings.simplefilter("ignore", DeprecationWarning)
        pid = os.fork()
    if not pid:
        _work(work, parent, out, err)
    return _Worker(work, pid, out, err)


def _work(work: Work, parent: int, out: int, err: int) -> NoReturn:
    """Do a piece of work in the forked process, and exit without the parent's exit handlers."""
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
    """Raise KeyboardInterrupt for the first SIGINT only: the terminal sends one, and the parent another."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise KeyboardInterrupt


def _end_with(parent: int) -> None:
    import ctypes

    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGINT)
    if os.getppid() != parent:
        os._exit(INTERRUPTED)


def _tell(worker: _Worker, code: int) -> int:
    """Print the output of a process, and the signal that ended it if one did; return its exit code."""
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
