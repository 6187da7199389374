"""The sign of life and its probe, told apart from every way in which a relay can be dead."""

import errno
import itertools
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

import pytest

import syncrelay.cli.healthcheck
from syncrelay.cli.healthcheck import VARIABLE, Heartbeat, ailment

_SECOND_NS = 1_000_000_000


def test_a_relay_is_healthy_once_it_has_beaten_whatever_an_earlier_run_left(tmp_path):
    (tmp_path / "beat").write_text(f"{time.monotonic_ns():020d}\n")
    with Heartbeat(tmp_path / "beat") as heartbeat:
        assert ailment(tmp_path / "beat") == "the relay is not receiving yet"
        heartbeat.beat()
        assert ailment(tmp_path / "beat") is None


@pytest.mark.parametrize(
    ("written", "ails"),
    [
        (lambda now: f"{now - 3600 * _SECOND_NS:020d}\n", "the receive loop last turned 3600 s ago"),
        # From before the machine started.
        (lambda now: f"{now + 3600 * _SECOND_NS:020d}\n", "the heartbeat is from an earlier run"),
        (lambda _: "root:x:0:0\n\udcff", "PATH is not a heartbeat of syncrelay"),
    ],
)
def test_what_is_no_beat_of_a_relay_that_turns_is_said(written, ails, tmp_path):
    path = tmp_path / "beat"
    path.write_bytes(written(time.monotonic_ns()).encode(errors="surrogateescape"))
    assert ailment(path) == ails.replace("PATH", str(path))


def test_a_full_disk_is_said_once_and_ends_with_it(tmp_path, monkeypatch, caplog):
    def refuse(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with Heartbeat(tmp_path / "beat", now=itertools.count(0, _SECOND_NS).__next__) as heartbeat:
        with monkeypatch.context() as patched:
            patched.setattr(os, "pwrite", refuse)
            heartbeat.beat()
            heartbeat.beat()
        assert caplog.text.count("cannot be written: No space left on device; trying again") == 1
        heartbeat.beat()
        assert (tmp_path / "beat").read_text() == f"{2 * _SECOND_NS:020d}\n"


def test_nothing_is_left_after_the_end(tmp_path):
    with Heartbeat(tmp_path / "beat") as heartbeat:
        heartbeat.beat()
    assert list(tmp_path.iterdir()) == []
    assert "No such file" in (ailment(tmp_path / "beat") or "")


def test_a_link_that_someone_laid_is_not_followed(tmp_path):
    (tmp_path / "precious").write_text("kept")
    (tmp_path / "beat").symlink_to(tmp_path / "precious")
    with pytest.raises(OSError, match="symbolic links"):
        Heartbeat(tmp_path / "beat")
    assert (tmp_path / "precious").read_text() == "kept"


@contextmanager
def beating(heartbeat):
    """Beat on and on: a process that probes takes its time to start on a busy machine."""
    is_over = Event()

    def beat():
        while not is_over.wait(0.1):
            heartbeat.beat()

    heartbeat.beat()
    thread = Thread(target=beat)
    thread.start()
    yield
    is_over.set()
    thread.join()


@pytest.mark.parametrize(
    "command",
    [["-m", "syncrelay", "healthcheck"], ["-I", "-S", str(Path(syncrelay.cli.healthcheck.__file__))]],
    ids=["command", "bare"],
)
def test_the_command_and_the_bare_probe_say_the_same(tmp_path, command):
    def probe(**environment):
        run = subprocess.run(
            [sys.executable, *command], env={**os.environ, **environment}, capture_output=True, text=True, check=False
        )
        return run.returncode, run.stdout.strip()

    path = tmp_path / "beat"
    (tmp_path / "old").write_text(f"{time.monotonic_ns() - 3600 * _SECOND_NS:020d}\n")
    with Heartbeat(path) as heartbeat, beating(heartbeat):
        alive = probe(**{VARIABLE: str(path)})
    assert alive == (0, "receiving")
    assert probe(**{VARIABLE: str(path)})[0] == 1
    code, said = probe(**{VARIABLE: str(tmp_path / "old")})
    assert code == 1
    assert said.startswith("the receive loop last turned 36")
    assert probe(**{VARIABLE: ""}) == (1, f"{VARIABLE} is not set: it must name the heartbeat file")
