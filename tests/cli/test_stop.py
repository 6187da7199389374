"""The second signal: it ends the process whatever hangs, and wherever that is."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.command import ROOT
from tests.ros.processes import Process, ros_environment

# What hangs is begun only when the signals are in hand.
_HANGING = """
import ctypes, os, sys, threading, time
from syncrelay.cli.stop import StopRequest

def python():
    while True:
        time.sleep(60)

def lock():
    held = threading.Lock()
    held.acquire()
    held.acquire()

def fifo():
    os.mkfifo("pipe")
    open("pipe")

def library(load=ctypes.CDLL):
    # It is not even interrupted by a signal.
    mutex, loaded = ctypes.create_string_buffer(64), load(None)
    loaded.pthread_mutex_lock(mutex)
    loaded.pthread_mutex_lock(mutex)

def library_that_holds_all_of_python():
    # As rclpy holds it while DDS makes a node.
    library(ctypes.PyDLL)

stop = StopRequest()
stop.install()
if sys.argv[2] == "deferred":
    stop.defer()
else:
    stop.wake_with(lambda: None)
print("ready", flush=True)
globals()[sys.argv[1]]()
"""


def _hanging(tmp_path: Path, where: str, since: str = "deferred") -> Process:
    environment = ros_environment(domain=0, folder=tmp_path, python_path=[ROOT])
    argv = [sys.executable, "-c", _HANGING, where, since]
    process = Process("hanging", argv, environment=environment, folder=tmp_path)
    process.wait_until(lambda: process.stdout == "ready\n", "it to hang")
    return process


def _signal_twice(process: Process, first: signal.Signals, second: signal.Signals) -> int:
    process.send(first)
    # The kernel has taken note of the first, and leaves the second to nobody.
    process.wait_until(lambda: not process.handles(second), "the first signal to be taken")
    process.send(second)
    return process.wait()


_ANYWHERE = ["python", "lock", "fifo", "library", "library_that_holds_all_of_python"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=lambda number: number.name)
@pytest.mark.parametrize("where", _ANYWHERE)
def test_a_second_signal_ends_what_hangs(where: str, number: signal.Signals, tmp_path: Path):
    assert _signal_twice(_hanging(tmp_path, where), number, number) == -number


@pytest.mark.parametrize("since", ["deferred", "running"])
def test_the_second_may_be_another_than_the_first(since: str, tmp_path: Path):
    hanging = _hanging(tmp_path, "python", since)
    assert _signal_twice(hanging, signal.SIGINT, signal.SIGTERM) == -signal.SIGTERM


def test_the_second_may_be_another_though_the_handlers_turn_never_comes(tmp_path: Path):
    hanging = _hanging(tmp_path, "library")
    hanging.send(signal.SIGINT)
    hanging.wait_until(lambda: not hanging.handles(signal.SIGINT), "the first signal to be taken")
    hanging.send(signal.SIGTERM)
    assert hanging.wait() == -signal.SIGTERM


def test_of_pid_1_which_the_kernel_protects_the_second_signal_is_the_end_too(tmp_path: Path):
    argv = ["unshare", "--pid", "--fork", "--kill-child", "--map-root-user", sys.executable, "-c", _SELF_SIGNALLED]
    environment = ros_environment(domain=0, folder=tmp_path, python_path=[ROOT])
    done = subprocess.run(argv, env=environment, capture_output=True, text=True, check=False, timeout=120)
    if "unshare" in done.stderr:
        pytest.skip(f"no process namespace can be made here: {done.stderr}")
    assert (done.returncode, done.stdout) == (128 + signal.SIGTERM, "1\n1 asked to end\n")


_SELF_SIGNALLED = """
import os, signal
from syncrelay.cli.stop import StopRequest
stop = StopRequest()
stop.install()
stop.defer()
print(os.getpid(), flush=True)
os.kill(1, signal.SIGINT)
print(os.getpid(), "asked to end" if stop.requested else "", flush=True)
os.kill(1, signal.SIGTERM)
print("still there", flush=True)
"""
