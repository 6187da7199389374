"""A terminal that a process is started on."""

import os
import pty
import select
import struct
import subprocess
import termios
import time
from contextlib import contextmanager, suppress
from fcntl import ioctl

from tests.cli.command import ROOT

_DEADLINE_S = 60


def read_to_the_end(descriptor):
    """All that was written to a terminal that nobody has open any more; a single read may cut it anywhere."""
    parts = []
    with suppress(OSError):  # once nobody writes, Linux says EIO
        while part := os.read(descriptor, 65536):
            parts.append(part)
    return b"".join(parts)


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
        while text not in self.written:
            assert self._read(end), f"waited in vain for {text!r}: {self.written!r}"

    def wait_for_end(self):
        end = time.monotonic() + _DEADLINE_S
        while self._read(end):
            pass
        return self._process.wait(_DEADLINE_S)

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
    try:
        yield Terminal(process, ours)
    finally:
        process.kill()
        process.wait()
        os.close(ours)
