"""Work in forked processes, which change nothing of what they see, and end with this one."""

import ctypes
import multiprocessing
import os
import signal
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.context import ForkProcess
from typing import Any, Final, TypeVar

T = TypeVar("T")

_PR_SET_PDEATHSIG: Final = 1


def fork(work: Callable[[Connection], object]) -> tuple[ForkProcess, Connection]:
    """Begin work in a process of its own; return it, and what it sends, pickled."""
    context = multiprocessing.get_context("fork")
    sent, into = context.Pipe(duplex=False)
    process = context.Process(target=_begin, args=(work, os.getpid(), into), daemon=True)
    with warnings.catch_warnings():
        # About threads: those of numpy and pyarrow are idle, and are made anew in the child; a bar is of no use to it.
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    into.close()
    return process, sent


def end_with_parent() -> None:
    """Have the kernel kill this process when its parent ends, however that ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def side_by_side(calls: Sequence[Callable[[], T]]) -> list[T]:
    """Return what calls return, as if each was made in turn, on this machine's cores; results are pickled."""
    cores = len(os.sched_getaffinity(0))
    outcomes = []
    for begin in range(0, len(calls), cores):
        # The first of them is made here.
        here, *there = calls[begin : begin + cores]
        begun = [fork(partial(_call, call)) for call in there]
        try:
            outcomes += [here(), *(_outcome(sent, call) for (_, sent), call in zip(begun, there, strict=True))]
        finally:
            for process, _ in begun:
                process.kill()
                process.join()
    return outcomes


def _begin(work: Callable[[Connection], object], parent: int, into: Connection) -> None:
    for number in (signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, signal.SIG_DFL)
    # A terminal sends Ctrl-C to all processes: the parent decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM))
    end_with_parent()
    if os.getppid() == parent:
        work(into)


def _call(call: Callable[[], Any], into: Connection) -> None:
    try:
        into.send((call(), None))
    except Exception as error:  # noqa: BLE001  raised again where it was asked for
        into.send((None, error))


def _outcome(sent: Connection, call: Callable[[], T]) -> T:
    try:
        with sent:
            found, error = sent.recv()
    except EOFError:
        # It was killed, as where memory is short: what it did is done here, when there is more.
        return call()
    if error is not None:
        raise error
    result: T = found
    return result
