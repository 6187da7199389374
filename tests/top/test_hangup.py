"""A terminal that goes away, at any moment: top ends, rather than wait for it."""

import os
import pty
import select
import signal
import subprocess
import sys
import time

import pytest

from tests.status.support.serving import running
from tests.top import states

_DEADLINE_S = 60


@pytest.mark.parametrize("inherited", [signal.SIG_DFL, signal.SIG_IGN])
@pytest.mark.parametrize("delay_s", [0.0, 0.03, 0.08, 0.2, 0.6])
def test_it_ends_with_its_terminal_however_soon_that_goes(delay_s: float, inherited: signal.Handlers):
    with running(states.healthy()) as server:
        ours, its = pty.openpty()
        process = subprocess.Popen(
            # The terminal has to be the process's own, to have it told that it is gone.
            [sys.executable, "-c", _ON_A_TERMINAL_OF_ITS_OWN, server.url, inherited.name],
            stdin=its,
            stdout=its,
            stderr=its,
            env={**os.environ, "TERM": "xterm-256color", "LANG": "C.UTF-8"},
            start_new_session=True,
        )
        os.close(its)
        select.select([ours], [], [], _DEADLINE_S)
        until = time.monotonic() + delay_s
        while (left := until - time.monotonic()) > 0:
            if select.select([ours], [], [], left)[0]:
                os.read(ours, 65_536)
        os.close(ours)
        try:
            process.wait(_DEADLINE_S)
        finally:
            process.kill()
            process.wait()
        assert process.returncode in {0, 1, 128 + 1, -1}


_ON_A_TERMINAL_OF_ITS_OWN = """
import fcntl, signal, sys, termios
# nohup and many CI runners start what they run with SIGHUP ignored.
signal.signal(signal.SIGHUP, signal.Handlers[sys.argv[2]])
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
from syncrelay.cli import main
sys.argv = ["syncrelay", "top", "--url", sys.argv[1]]
sys.exit(main())
"""
