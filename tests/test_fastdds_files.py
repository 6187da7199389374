"""Files of Fast DDS that a dead process left are removed; those of living processes stay."""

import fcntl
import mmap
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from syncrelay.fastdds_files import held_by, remove_unused
from tests.ros.processes import wait_until

PORT, SEGMENT = "fastrtps_port7413", "fastrtps_0123456789abcdef"
_FILES = [PORT, f"{PORT}_el", f"{PORT}_sl", f"sem.{PORT}_mutex", SEGMENT, f"{SEGMENT}_el"]
_HOLD = {
    "map": "import mmap, sys; f = open(sys.argv[1], 'r+b'); held = mmap.mmap(f.fileno(), 0); f.close(); input()",
    "open": "import sys; held = open(sys.argv[1]); input()",
}


@pytest.fixture
def folder(tmp_path):
    for name in (*_FILES, "fastrtps_port7415", "sem.another"):
        (tmp_path / name).write_bytes(b"x")
    return tmp_path


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_what_nobody_has_is_removed_with_its_locks_and_its_semaphore(folder):
    remove_unused({PORT, SEGMENT, "fastrtps_port7999"}, folder)
    assert names_in(folder) == {"fastrtps_port7415", "sem.another"}


@pytest.mark.parametrize(
    ("how", "file"), [("map", PORT), ("open", f"{PORT}_el"), ("open", f"{PORT}_sl"), ("map", f"sem.{PORT}_mutex")]
)
def test_what_a_living_process_has_stays_with_all_beside_it_until_that_ends(folder, how, file):
    with subprocess.Popen([sys.executable, "-c", _HOLD[how], folder / file], stdin=subprocess.PIPE) as holder:
        wait_until(lambda: held_by(holder.pid, folder) == {PORT}, "the file in use")
        remove_unused({PORT, SEGMENT}, folder)
        assert names_in(folder) == {*_FILES[:4], "fastrtps_port7415", "sem.another"}
        holder.communicate(b"\n")
    remove_unused({PORT}, folder)
    assert names_in(folder) == {"fastrtps_port7415", "sem.another"}


def test_what_only_this_process_has_is_removed(folder):
    with (folder / f"{PORT}_el").open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        remove_unused({PORT}, folder)
    assert names_in(folder) == {*_FILES[4:], "fastrtps_port7415", "sem.another"}


def test_a_lock_keeps_its_file_though_no_process_is_seen_to_have_it(folder):
    ours, theirs = socket.socketpair()
    with ours, theirs:
        with (folder / f"{SEGMENT}_el").open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            # The descriptor is in flight, so no /proc/PID/fd shows it, as with a process of another container.
            socket.send_fds(ours, [b"."], [lock.fileno()])
        remove_unused({PORT, SEGMENT}, folder)
    assert names_in(folder) == {*_FILES[4:], "fastrtps_port7415", "sem.another"}


def test_a_file_that_was_removed_while_it_was_mapped_is_held_no_more(folder):
    with (folder / SEGMENT).open("r+b") as file, mmap.mmap(file.fileno(), 0):
        assert held_by(os.getpid(), folder) == {SEGMENT}
        (folder / SEGMENT).unlink()
        assert held_by(os.getpid(), folder) == set()


def test_of_a_process_that_is_gone_nothing_is_held():
    with subprocess.Popen([sys.executable, "-c", ""]) as gone:
        pass
    assert held_by(gone.pid) == set()
