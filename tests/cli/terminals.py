"""A terminal that a process is started on."""

import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time
from contextlib import contextmanager
from fcntl import ioctl

from tests.cli.command import ROOT

_DEADLINE_S = 60
_ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b[=>]|[\r\x07]")


class Terminal:
    """A process on a terminal of its own, and all that it wrote."""

    def __init__(self, process, descriptor):
        self._process, self._descriptor = process, descriptor
        self._written = b""

    @property
    def pid(self):
        return self._process.pid

    @property
    def written(self):
        return self._written.decode(errors="replace")

    def press(self, key):
        os.write(self._descriptor, key.encode())

    def wait_for(self, text):
        end = time.monotonic() + _DEADLINE_S
        while text not in _ESCAPES.sub("", self.written):
            assert self._read(end), f"waited in vain for {text!r}: {self.written!r}"

    def type(self, text, *, until):
        """Type a text, and wait until something is shown from then on."""
        self._written = b""
        self.press(text)
        self.wait_for(until)

    def wait_for_end(self, deadline_s=_DEADLINE_S):
        end = time.monotonic() + deadline_s
        while self._read(end):
            pass
        return self._process.wait(_DEADLINE_S)

    def hang_up(self, after_s):
        """Take the terminal away, so long after the first of what is written."""
        self._read(time.monotonic() + _DEADLINE_S)
        end = time.monotonic() + after_s
        while time.monotonic() < end:
            self._read(end)
        self.close()
        return self._process.wait(_DEADLINE_S)

    def close(self):
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _read(self, end):
        if not select.select([self._descriptor], [], [], max(0, end - time.monotonic()))[0]:
            return False
        try:
            chunk = os.read(self._descriptor, 65536)
        except OSError:  # the other end is closed
            return False
        self._written += chunk
        return bool(chunk)


@contextmanager
def on_terminal(argv, *, folder, environ):
    """Start a process on a terminal of 80x24; `environ` is put into its environment."""
    ours, theirs = pty.openpty()
    ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    kept = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "COLORTERM")}
    process = subprocess.Popen(
        argv,
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env=kept | {"TERM": "xterm-256color", "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8", **environ},
        cwd=folder,
        start_new_session=True,
    )
    os.close(theirs)
    terminal = Terminal(process, ours)
    try:
        yield terminal
    finally:
        process.kill()
        process.wait()
        terminal.close()


def shown_on_terminal(*words, folder, **environ):
    """Run syncrelay on a terminal to its end: its exit code, and all that it wrote."""
    argv = [sys.executable, "-m", "syncrelay", *words]
    with on_terminal(argv, folder=folder, environ=environ) as terminal:
        return terminal.wait_for_end(), terminal.written
