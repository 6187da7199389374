"""Several recordings at once: what is printed is what one after another prints; what one breaks is its own."""

import json
import os
import signal
import subprocess
import sys

import pytest

from tests.cli.command import ROOT, run, run_python
from tests.recordings.bag.making import rig, write_mcap
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs

_TOPICS = ("/camera", "/lidar")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("several")
    group = {"policy": "approximate_time", "slop": "1ms", "topics": inputs(dict.fromkeys(_TOPICS, VECTOR))}
    (made / "f.yaml").write_text(config({"front": group}))
    for name, count in (("long", 300), ("short", 20)):
        write_mcap(made / f"{name}.mcap", rig(count))
    (made / "empty.mcap").write_bytes(b"")
    return made


_BAGS = ("long.mcap", "empty.mcap", "short.mcap")


@pytest.mark.parametrize("words", [("--config", "f.yaml", "--jobs", "2"), _TOPICS, ("--jobs", "1")])
def test_several_recordings_print_what_one_after_another_prints(words, folder):
    alone = [run("analyze", bag, *words, folder=folder) for bag in _BAGS]
    done = run("analyze", *_BAGS, *words, folder=folder)
    assert done.stdout == "".join(each.stdout for each in alone)
    assert done.stderr == "".join(each.stderr for each in alone) == "syncrelay: empty.mcap: is empty\n"
    assert done.returncode == 1


def test_each_recording_is_a_line_of_json(folder):
    alone = run("analyze", "short.mcap", "--config", "f.yaml", "--json", folder=folder)
    done = run("analyze", "short.mcap", "long.mcap", "--config", "f.yaml", "--json", folder=folder)
    first, second = map(json.loads, done.stdout.splitlines())
    assert first == json.loads(alone.stdout)
    assert second["recording"] == "long.mcap"


def test_a_fault_of_the_file_is_told_once(folder):
    (folder / "bad.yaml").write_text((folder / "f.yaml").read_text().replace("slop", "slopp"))
    done = run("analyze", "short.mcap", "long.mcap", "--config", "bad.yaml", folder=folder)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.count("unknown key") == 1


def test_what_is_written_is_of_one_recording(folder):
    done = run("analyze", "short.mcap", "long.mcap", "--config", "f.yaml", "--html", "new.html", folder=folder)
    assert done.returncode == 2
    assert "--write and --html are for one recording, found 2" in done.stderr


def _script(body: str) -> str:
    lines = ("import os, signal, sys, time", "from syncrelay.cli.side_by_side import Work, side_by_side", body)
    return "\n".join(lines)


def test_a_process_that_dies_is_one_recordings_fault(folder):
    killed = 'Work("b.mcap", lambda: os.kill(os.getpid(), signal.SIGKILL))'
    broken = 'Work("c.mcap", lambda: 1 // 0)'
    works = f'[Work("a.mcap", lambda: print("a") or 0), {killed}, {broken}, Work("d.mcap", lambda: print("d") or 0)]'
    done = run_python("-c", _script(f"sys.exit(side_by_side({works}, jobs=2))"), folder=folder)
    assert (done.returncode, done.stdout) == (70, "a\nd\n")
    assert "syncrelay: b.mcap: the process that read it was ended by SIGKILL" in done.stderr
    assert "ZeroDivisionError" in done.stderr
    assert "syncrelay: it happened with the recording c.mcap" in done.stderr


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, -15), (signal.SIGKILL, -9)])
def test_no_process_is_left_when_the_command_is_ended_and_each_clears_away_what_it_made(number, code):
    begins = "    try:\n        os.write(told, b'%d\\n' % os.getpid())"
    works = "        while True:\n            time.sleep(0.01)"
    # A terminal interrupts each of them, and so does the command.
    clears = "    finally:\n        os.kill(os.getpid(), signal.SIGINT)\n        os.write(told, b'cleared ')"
    waits = f"def wait():\n{begins}\n{works}\n{clears}\n"
    runs = "sys.exit(guarded(lambda: side_by_side([Work('a', wait), Work('b', wait), Work('c', wait)], jobs=2)))"
    read, told = os.pipe()
    with subprocess.Popen(
        [sys.executable, "-c", _script(f"from syncrelay.cli.boundary import guarded\ntold = {told}\n{waits}{runs}")],
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONSAFEPATH": "1"},
        pass_fds=[told],
    ) as command:
        os.close(told)
        with os.fdopen(read) as pids:
            workers = [int(pids.readline()) for _ in range(2)]
            command.send_signal(number)
            assert command.wait(60) == code
            # It ends when none of them holds it.
            assert pids.read() == "cleared " * 2
        assert len(set(workers)) == 2
