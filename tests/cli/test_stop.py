"""The second signal: it ends the process whatever hangs, and wherever that is."""

import signal
import subprocess
import sys
from itertools import cycle
from pathlib import Path

import pytest

from tests.doctor.environments import namespaces
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


def _hanging(tmp_path: Path, where: str, since: str) -> Process:
    environment = ros_environment(domain=0, folder=tmp_path)
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
_TERM, _INT = signal.SIGTERM, signal.SIGINT


@pytest.mark.parametrize(
    ("where", "since", "first", "second"),
    [
        *((where, "deferred", number, number) for where, number in zip(_ANYWHERE, cycle((_TERM, _INT)))),
        *((where, "running", _INT, _INT) for where in ("python", "library")),
        *(("python", since, _INT, _TERM) for since in ("deferred", "running")),
    ],
)
def test_a_second_signal_ends_what_hangs(
    where: str, since: str, first: signal.Signals, second: signal.Signals, tmp_path: Path
):
    assert _signal_twice(_hanging(tmp_path, where, since), first, second) == -second


def test_the_second_may_be_another_though_the_handlers_turn_never_comes(tmp_path: Path):
    hanging = _hanging(tmp_path, "library", "deferred")
    hanging.send(signal.SIGINT)
    hanging.wait_until(lambda: not hanging.handles(signal.SIGINT), "the first signal to be taken")
    hanging.send(signal.SIGTERM)
    assert hanging.wait() == -signal.SIGTERM


_RUNNING = """
import os, signal, sys, threading
from syncrelay.cli.stop import StopRequest
asked = threading.Event()
stop = StopRequest()
stop.install()
stop.defer()
stop.wake_with(asked.set)
for name in sys.argv[1:]:
    os.kill(os.getpid(), signal.Signals[name])
print(os.getpid() == 1, stop.requested and asked.is_set())
"""


@pytest.mark.parametrize("names", ["SIGINT SIGINT", "SIGTERM SIGTERM", "SIGINT SIGTERM", "SIGTERM SIGINT"])
def test_while_it_runs_a_second_signal_right_after_the_first_is_the_same_request(names: str, tmp_path: Path):
    done = _run([sys.executable, "-c", _RUNNING, *names.split()], tmp_path)
    assert (done.returncode, done.stdout) == (0, "False True\n")


# As when DDS hangs as the relay leaves it, and holds all of Python: the thread that counts signals gets no turn.
_HANGING_AT_ITS_END = """
import ctypes, os, signal, time
from syncrelay.cli import stop as module
stop = module.StopRequest()
stop.install()
stop.defer()
stop.wake_with(lambda: None)
action = ctypes.create_string_buffer(module._ACTION_BYTES)

def has_a_handler_for_ever():
    ctypes.CDLL(None).sigaction(signal.SIGTERM, None, action)
    taken_once = ctypes.c_uint.from_buffer(action, module._FLAGS_AT).value & module._SA_RESETHAND
    return any(action.raw[:8]) and not taken_once

os.kill(os.getpid(), signal.SIGTERM)
while has_a_handler_for_ever():
    time.sleep(0.001)
print("ready", flush=True)
mutex, python = ctypes.create_string_buffer(64), ctypes.PyDLL(None)
python.pthread_mutex_lock(mutex)
python.pthread_mutex_lock(mutex)
"""


def test_what_hangs_as_it_ends_is_ended_by_the_third_signal_at_the_latest(tmp_path: Path):
    environment = ros_environment(domain=0, folder=tmp_path)
    argv = [sys.executable, "-c", _HANGING_AT_ITS_END]
    process = Process("hanging", argv, environment=environment, folder=tmp_path)
    process.wait_until(lambda: process.stdout == "ready\n", "it to hang")
    process.send(signal.SIGTERM)
    process.wait_until(lambda: not process.running() or not process.handles(signal.SIGTERM), "the second to be taken")
    process.send(signal.SIGTERM)
    assert process.wait() == -signal.SIGTERM


def test_of_pid_1_which_the_kernel_protects_the_second_signal_is_the_end_too(tmp_path: Path):
    done = _run_as_pid_1(_SELF_SIGNALLED, folder=tmp_path)
    assert (done.returncode, done.stdout) == (128 + signal.SIGTERM, "1\n1 asked to end\n")


def test_of_pid_1_too_a_second_signal_right_after_the_first_is_the_same_request(tmp_path: Path):
    done = _run_as_pid_1(_RUNNING, "SIGTERM", "SIGINT", "SIGTERM", folder=tmp_path)
    assert (done.returncode, done.stdout) == (0, "True True\n")


def _run_as_pid_1(script: str, *words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    first = namespaces("--pid", "--fork", "--kill-child", "--map-root-user")
    return _run([*first, sys.executable, "-c", script, *words], folder)


def _run(argv: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    environment = ros_environment(domain=0, folder=folder)
    return subprocess.run(argv, env=environment, capture_output=True, text=True, check=False, timeout=120)


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
