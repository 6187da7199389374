"""Calls side by side give what they give in turn, errors too."""

import os
import signal
from functools import partial

import pytest

from syncrelay.recordings.side_by_side import side_by_side


@pytest.fixture(autouse=True)
def _two_cores(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})


def test_results_are_in_the_order_of_the_calls_and_every_other_one_is_made_elsewhere():
    found = side_by_side([partial(lambda number: (number, os.getpid()), number) for number in range(5)])
    assert [number for number, _ in found] == [0, 1, 2, 3, 4]
    assert [process == os.getpid() for _, process in found] == [True, False, True, False, True]


def test_an_error_elsewhere_is_raised_here():
    with pytest.raises(ZeroDivisionError):
        side_by_side([lambda: 0, lambda: 1 // 0])


def test_what_is_killed_elsewhere_is_made_here():
    here = os.getpid()

    def found() -> str:
        if os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return "here"

    assert side_by_side([found, found]) == ["here", "here"]
