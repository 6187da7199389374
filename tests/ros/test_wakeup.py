"""A rest that a signal's handler ends, at whatever moment the signal comes."""

import os
import signal
import subprocess
import sys

from syncrelay.wakeup import Wakeup
from tests.ros.processes import wait_until

_SIGNALS = 3_000
# Its handler ends the rest, as the relay's does. In the place of a Wakeup a threading.Event hangs soon.
_RESTS = f"""
import signal
from syncrelay.wakeup import Wakeup

wakeup, seen = Wakeup(), 0

def handler(*_):
    global seen
    seen += 1
    wakeup.set()

signal.signal(signal.SIGHUP, handler)
print("ready", flush=True)
while seen < {_SIGNALS}:
    wakeup.wait(1e-5)
signal.signal(signal.SIGHUP, signal.SIG_IGN)
"""


def test_signals_that_come_in_the_midst_of_a_rest_never_hang_it():
    with subprocess.Popen([sys.executable, "-c", _RESTS], stdout=subprocess.PIPE) as resting:
        try:
            assert resting.stdout is not None
            assert resting.stdout.readline() == b"ready\n"

            # From another process, which no lock of the interpreter lets send at certain moments only.
            def ended() -> bool:
                os.kill(resting.pid, signal.SIGHUP)
                return resting.poll() is not None

            wait_until(
                ended,
                f"{_SIGNALS} handled signals",
                poll_s=1e-4,
                # Each needs a turn of both processes.
                deadline_s=250,
            )
            assert resting.returncode == 0
        finally:
            resting.kill()


def test_a_rest_ends_when_it_is_told_to_and_once():
    wakeup = Wakeup()
    assert not wakeup.wait(0)
    wakeup.set()
    wakeup.set()
    assert wakeup.wait(600)
    assert not wakeup.wait(0)
