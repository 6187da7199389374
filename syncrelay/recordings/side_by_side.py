"""Calls side by side on this machine's cores, each in a forked process, which changes nothing of what it sees."""

import multiprocessing
import os
import signal
import warnings
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from typing import Any, NoReturn, TypeVar

T = TypeVar("T")


def side_by_side(calls: Sequence[Callable[[], T]]) -> list[T]:
    """Return what calls return, as if each was made in turn; results are pickled.

    In a worker, beside which there are others, they are made in turn.
    """
    cores = len(os.sched_getaffinity(0))
    if cores == 1 or len(calls) == 1 or multiprocessing.current_process().daemon:
        return [call() for call in calls]
    outcomes = []
    for begin in range(0, len(calls), cores):
        # The first of them is made here.
        here, *there = calls[begin : begin + cores]
        begun = [_fork(call) for call in there]
        outcomes += [here(), *(_outcome(each, call) for each, call in zip(begun, there, strict=True))]
    return outcomes


def _fork(call: Callable[[], Any]) -> Connection:
    context = multiprocessing.get_context("fork")
    outcome, into = context.Pipe(duplex=False)
    with warnings.catch_warnings():
        # About threads: those of numpy are idle, and that of a bar is not needed in the child.
        warnings.simplefilter("ignore", DeprecationWarning)
        context.Process(target=_work, args=(call, into), daemon=True).start()
    into.close()
    return outcome


def _work(call: Callable[[], Any], into: Connection) -> NoReturn:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    try:
        into.send((call(), None))
    except Exception as error:  # noqa: BLE001  raised again where it was asked for
        into.send((None, error))
    os._exit(0)


def _outcome(outcome: Connection, call: Callable[[], T]) -> T:
    try:
        found, error = outcome.recv()
    except EOFError:
        # It was killed, as where memory is short: what it did is done here, when there is more.
        return call()
    if error is not None:
        raise error
    result: T = found
    return result
