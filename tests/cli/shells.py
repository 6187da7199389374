"""Shells on a terminal of their own, in which a test types and reads."""

import os
import pty
import re
import select
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Self

_PATIENCE_S = 60.0
_ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b[=>]|[\r\x07]")


class Shell:
    """An interactive shell; a context manager that ends it."""

    def __init__(self, argv: Sequence[str], *, folder: Path, environ: dict[str, str]) -> None:
        self._here, there = pty.openpty()
        self._process = subprocess.Popen(
            argv, cwd=folder, env=environ, stdin=there, stdout=there, stderr=there, start_new_session=True
        )
        os.close(there)
        self._shown = b""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exception: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._here)

    def type(self, text: str, *, until: str) -> str:
        """Type a text and return what is shown from then on, once `until` is among it."""
        self._shown = b""
        os.write(self._here, text.encode())
        end = time.monotonic() + _PATIENCE_S
        while until not in self.shown:
            assert time.monotonic() < end, f"{until!r} did not come after {text!r}: {self.shown!r}"
            if select.select([self._here], [], [], 0.2)[0]:
                self._shown += os.read(self._here, 65536)
        return self.shown

    @property
    def shown(self) -> str:
        return _ESCAPES.sub("", self._shown.decode(errors="replace"))
