"""A run that is ended: in order by a signal, or by kill -9 at any moment; no worker is left, and the next goes on."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

from tests.cli.command import ROOT
from tests.faults.extent import chosen
from tests.recordings.fleet.fleets import FILE, LEDGER, entries, make_fleet, replay_into, tree
from tests.recordings.fleet.tasks import OBEDIENT, attempts_of
from tests.ros.processes import children_of, is_alive, wait_until

pytestmark = pytest.mark.process

_DEADLINE_S = 60
_KILLS = chosen(short=3, long=50)
ENVIRON = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONSAFEPATH": "1"}


def lines(out):
    return (out / LEDGER).read_text().count("\n") if (out / LEDGER).exists() else 0


@contextmanager
def at_work(folder):
    """A command with two recordings done and two that take forever; its workers on them."""
    for name in ("a", "b"):
        (folder / f"{name}.mcap").write_text(f"longer than the others: {name}")
    for name in ("x", "y"):
        (folder / f"{name}.mcap").write_text("hang")
    words = [sys.executable, "-c", OBEDIENT, "local", "."]
    with subprocess.Popen(words, cwd=folder, env=ENVIRON, stdout=-1, stderr=-1, text=True) as command:
        try:
            wait_until(
                lambda: all(map(attempts_of, (folder / "x.mcap", folder / "y.mcap"))), "both workers", poll_s=0.005
            )
            yield command, children_of(command.pid)
        finally:
            command.kill()


@pytest.mark.parametrize(
    ("number", "code", "reaches_workers"),
    [
        pytest.param(signal.SIGINT, 130, True, id="Ctrl-C of a terminal"),
        pytest.param(signal.SIGINT, 130, False, id="SIGINT"),
        pytest.param(signal.SIGTERM, 143, False, id="SIGTERM"),
    ],
)
def test_a_signal_ends_it_in_order(number, code, reaches_workers, tmp_path):
    with at_work(tmp_path) as (command, workers):
        for pid in (*(workers if reaches_workers else ()), command.pid):
            os.kill(pid, number)
        output, told = command.communicate(timeout=_DEADLINE_S)
    assert (command.returncode, output) == (code, "")
    assert f"ended by {number.name}: 4 recordings: 2 done, 2 not done; the same command does the rest" in told
    assert not any(map(is_alive, workers))
    assert not (tmp_path / "out" / ".partial").exists()
    assert set(entries(tmp_path / "out")) == {"a", "b"}


def test_no_worker_outlives_a_command_that_is_killed(tmp_path):
    with at_work(tmp_path) as (command, workers):
        command.kill()
        wait_until(lambda: not any(map(is_alive, workers)), "the end of the workers")


@pytest.mark.faults
def test_a_run_that_is_killed_at_any_moment_ends_as_an_undisturbed_one(tmp_path, figures):
    count = 8
    make_fleet(tmp_path, counts=range(20, 20 + count))
    assert replay_into(tmp_path, into="undisturbed").returncode == 0
    chance = random.Random(24)
    words = [sys.executable, "-m", "syncrelay", *f"fleet replay bags --config {FILE} --into out --jobs 2".split()]
    killed = {"command": 0, "worker": 0}
    while sum(killed.values()) < _KILLS:
        if lines(tmp_path / "out") > count:
            # About all were done before as many were killed as there shall be: whose folder was not yet in place when
            # its line was, has two lines.
            assert replay_into(tmp_path).returncode == 0
            assert tree(tmp_path / "out") == tree(tmp_path / "undisturbed")
            shutil.rmtree(tmp_path / "out")
        with subprocess.Popen(words, cwd=tmp_path, env=ENVIRON, stderr=-1, stdout=-1, text=True) as command:
            awaited = max(1, lines(tmp_path / "out") + chance.randint(0, 2))
            wait_until(
                lambda awaited=awaited, command=command: (
                    lines(tmp_path / "out") >= awaited or command.poll() is not None
                ),
                "a line of the ledger",
                poll_s=0.005,
            )
            for pid in children_of(command.pid)[: chance.randint(0, 1)]:
                os.kill(pid, signal.SIGKILL)
                killed["worker"] += 1
            time.sleep(chance.random() * 0.03)
            workers = children_of(command.pid)
            number = chance.choice((signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM))
            command.send_signal(number)
            _, said = command.communicate()
            assert "bug in syncrelay" not in said
            # Python that is just starting or ending handles signals in its own way; and where SIGINT met code that is
            # made from text, as that of dataclasses, Python ends by the signal itself, which a shell calls 130, too.
            assert command.returncode in {128 + number, -number} or "ended by" not in said
            killed["command"] += command.returncode != 0
            wait_until(lambda workers=workers: not any(map(is_alive, workers)), "the end of the workers")
    ended = replay_into(tmp_path)
    assert ended.returncode == 0
    assert tree(tmp_path / "out") == tree(tmp_path / "undisturbed")
    figures(
        f"replay of {count} recordings, the command killed or interrupted {killed['command']} times and a worker killed"
        f" {killed['worker']} times: in the end what an undisturbed run leaves, byte for byte"
    )
