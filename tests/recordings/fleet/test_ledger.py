"""The ledger of a folder of results: what it keeps, whatever was done to it, and who may write it."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace

import pytest

from syncrelay.errors import SyncRelayError
from syncrelay.recordings.fleet.content import ResultFile
from syncrelay.recordings.fleet.ledger import LEDGER, Entry, Ledger, State
from tests.cli.command import ROOT, run_python

ONE = Entry(
    name="x-0123456789abcdef",
    state=State.DONE,
    recording="/bags/\udcff.mcap",
    fingerprint="replay version:1",
    content="xxh128:00",
    size=7,
    facts={"groups": [{"sets": 3}], "problems": ["none of it"]},
    files={"sets.mcap": ResultFile(3, "ab")},
)
TWO = Entry("y-0123456789abcdef", State.FAILED, "/bags/y.mcap", "replay version:1", error="y: is empty")


@pytest.fixture
def out(tmp_path):
    with Ledger(tmp_path / "out") as ledger:
        ledger.append(TWO)
        ledger.append(ONE)
    return tmp_path / "out"


def test_it_keeps_what_was_written(out):
    with Ledger(out) as ledger:
        # Of facts only what decides an exit code, as there may be a hundred thousand.
        assert ledger.entries == {ONE.name: replace(ONE, facts={"problems": ["none of it"]}), TWO.name: TWO}


def test_a_line_cut_off_anywhere_is_as_good_as_not_written(out):
    whole = (out / LEDGER).read_bytes()
    begin = whole.rstrip(b"\n").rfind(b"\n") + 1
    for end in range(begin, len(whole)):
        (out / LEDGER).write_bytes(whole[:end])
        with Ledger(out) as ledger:
            assert (list(ledger.entries), ledger.unreadable) == ([TWO.name], 0)
            ledger.append(ONE)
        assert (out / LEDGER).read_bytes() == whole


def test_a_ledger_cut_off_as_it_began_is_a_new_one(out):
    whole = (out / LEDGER).read_bytes()
    for end in range(whole.index(b"\n")):
        (out / LEDGER).write_bytes(whole[:end])
        with Ledger(out) as ledger:
            assert ledger.entries == {}


@pytest.mark.parametrize(
    "line",
    [
        b"\xff\x00",
        b"[]",
        b"{}",
        b"[" * 100_000,
        json.dumps({"name": "../../x-0123456789abcdef", "state": "done", "recording": "", "fingerprint": ""}).encode(),
        json.dumps({"name": ONE.name, "state": "done", "recording": [5], "fingerprint": ""}).encode(),
        json.dumps({"name": ONE.name, "state": "done", "recording": "", "fingerprint": "", "files": [1]}).encode(),
    ],
)
def test_a_line_that_tells_nothing_is_counted(line, out):
    lines = (out / LEDGER).read_bytes().split(b"\n")
    (out / LEDGER).write_bytes(b"\n".join([*lines[:2], line, *lines[2:]]))
    with Ledger(out) as ledger:
        assert (set(ledger.entries), ledger.unreadable) == ({ONE.name, TWO.name}, 1)


@pytest.mark.parametrize("text", ["{}\n", '{"syncrelay_ledger": 2}\n', "notes"])
def test_another_file_of_its_name_is_refused(text, out):
    (out / LEDGER).write_text(text)
    with pytest.raises(SyncRelayError, match="is not a ledger of this syncrelay"):
        Ledger(out)
    assert (out / LEDGER).read_text() == text


def test_a_folder_of_other_files_and_a_file_in_its_place_are_refused(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(SyncRelayError, match=r"holds files and no _ledger\.jsonl: name an empty folder"):
        Ledger(tmp_path)
    with pytest.raises(SyncRelayError, match=r"out: cannot be written: File exists"):
        Ledger(tmp_path / "out")


_OPENS = (
    "import sys; from pathlib import Path\n"
    "from syncrelay.recordings.fleet.ledger import Ledger; Ledger(Path(sys.argv[1]))"
)


@pytest.mark.process
def test_a_second_process_is_refused_while_the_first_is_at_work(out):
    with Ledger(out):
        assert "another command is at work in it" in run_python("-c", _OPENS, str(out), folder=out).stderr
    assert run_python("-c", _OPENS, str(out), folder=out).returncode == 0


_FORKS = """
import os, sys, time
from pathlib import Path
from syncrelay.recordings.fleet.ledger import Ledger
ledger = Ledger(Path(sys.argv[1]))
worker = os.fork() or time.sleep(60)
print(worker, flush=True)
os._exit(0)
"""


@pytest.mark.process
def test_a_worker_that_outlives_the_command_does_not_hold_the_lock(out):
    environ = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONSAFEPATH": "1"}
    with subprocess.Popen([sys.executable, "-c", _FORKS, str(out)], stdout=subprocess.PIPE, env=environ) as command:
        assert command.stdout is not None
        worker = int(command.stdout.readline())
        try:
            assert command.wait(60) == 0
            Ledger(out).__exit__(None, None, None)
        finally:
            os.kill(worker, signal.SIGKILL)
