"""Calls side by side give what they give in turn, errors too."""

import os
import signal
import time
from functools import partial
from pathlib import Path

import pytest

from syncrelay.recordings.forks import side_by_side
from tests.ros.processes import wait_until


@pytest.fixture(autouse=True)
def _two_cores(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})


def test_results_are_in_the_order_of_the_calls_and_every_other_one_is_made_elsewhere():
    found = side_by_side([partial(lambda number: (number, os.getpid()), number) for number in range(5)])
    assert [number for number, _ in found] == [0, 1, 2, 3, 4]
    assert [process == os.getpid() for _, process in found] == [True, False, True, False, True]


def test_what_works_elsewhere_ends_with_an_error_here(tmp_path):
    def asleep() -> None:
        (tmp_path / str(os.getpid())).touch()
        time.sleep(600)

    def failing() -> None:
        wait_until(lambda: list(tmp_path.iterdir()), "the other process")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        side_by_side([failing, asleep])
    (other,) = tmp_path.iterdir()
    assert not Path(f"/proc/{other.name}").exists()


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
