"""Runs the sensors of the simulated rig as child processes."""

import contextlib
import logging
import os
import signal
import subprocess
import sys
import tempfile
import time
from types import TracebackType
from typing import IO, Self

from syncrelay.errors import SyncRelayError
from syncrelay.fastdds_files import held_by, remove_unused
from syncrelay.rig.schedule import SENSORS

UP = "publishes"
"""What a sensor prints once its publisher exists."""

LEAVE_WITHIN_S = 50
"""How long a sensor may take to leave DDS after its stdin ends; then it is killed."""

# A sensor starts in 3 s and leaves DDS in 0.2 s; on a busy machine both take much longer.
_UP_WITHIN_S = 60.0
_END_WITHIN_S = 60.0
# After this, say what is waited for.
_SILENT_S = 3.0
_LOOK_EVERY_S = 1.0

_LOG = logging.getLogger("syncrelay")


class Rig:
    """Runs every sensor in a process of its own while entered.

    However this process ends, SIGKILL included, the sensors' stdin ends with it, and so do they: in an order
    that leaves nothing in /dev/shm. A sensor that hangs is killed, and what it left there is removed at the exit.
    """

    def __init__(self, *, seed: int) -> None:
        self._seed = seed
        self._sensors: dict[str, tuple[subprocess.Popen[bytes], IO[bytes]]] = {}
        self._held: dict[str, set[str]] = {name: set() for name in SENSORS}
        self._up_by = 0.0

    def __enter__(self) -> Self:
        start = time.time_ns()
        self._up_by = time.monotonic() + _UP_WITHIN_S
        for name in SENSORS:
            talk = tempfile.TemporaryFile()
            self._sensors[name] = (_start(name, seed=self._seed, start=start, talk=talk), talk)
        return self

    def is_up(self) -> bool:
        """Whether every sensor publishes. Raises SyncRelayError for one that does not in a minute, else as `check`."""
        self.check()
        late = {name: said for name, (_, talk) in self._sensors.items() if UP not in (said := _all_of(talk))}
        if late and time.monotonic() > self._up_by:
            words = "".join(f"\n{name}: {said[-2000:]}" for name, said in late.items() if said)
            raise SyncRelayError(f"the rig's {', '.join(late)} did not publish within {_UP_WITHIN_S:.0f} s{words}")
        return not late

    def check(self) -> None:
        """Raise RuntimeError when a sensor has ended by itself, with the end of what it said."""
        for name, (process, talk) in self._sensors.items():
            code = process.poll()
            if code is not None:
                raise RuntimeError(_end_of(name, code, talk))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # The error already names a sensor that had died before.
        to_tell = set(self._sensors) if error is None else set(self._running_at(0))
        for process, _ in self._sensors.values():
            assert process.stdin is not None  # noqa: S101 - a pipe was asked for
            process.stdin.close()
            # A sensor that is still importing does not read stdin yet. It can end at once, as DDS does not know it.
            process.terminate()
        began = time.monotonic()
        if late := self._note_held(self._running_at(began + _SILENT_S)):
            _LOG.warning("waiting for the rig's %s to end; another Ctrl-C ends the demo at once", ", ".join(late))
        end = began + _END_WITHIN_S
        while late and time.monotonic() < end:
            late = self._note_held(self._running_at(min(end, time.monotonic() + _LOOK_EVERY_S)))
        for name in late:
            self._sensors[name][0].kill()
        left = set()
        for name, (process, talk) in self._sensors.items():
            if (code := process.wait()) not in (0, -signal.SIGTERM):
                left |= self._held[name]
                if name in to_tell:
                    _LOG.warning("%s", _end_of(name, code, talk))
            talk.close()
        if left:
            remove_unused(left)

    def _note_held(self, late: list[str]) -> list[str]:
        """Note what these sensors hold in shared memory, which cannot be found out once they are dead. Returns them."""
        for name in late:
            self._held[name] |= held_by(self._sensors[name][0].pid)
        return late

    def _running_at(self, deadline: float) -> list[str]:
        """Wait until a deadline at most, and return the names of the sensors that still run."""
        for process, _ in self._sensors.values():
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(max(0, deadline - time.monotonic()))
        return [name for name, (process, _) in self._sensors.items() if process.poll() is None]


def _start(name: str, *, seed: int, start: int, talk: IO[bytes]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [
            sys.executable,
            "-m",
            "syncrelay.ros.sensor",
            name,
            f"--seed={seed}",
            f"--start={start}",
            "--until-stdin-ends",
        ],
        stdin=subprocess.PIPE,
        stdout=talk,
        stderr=talk,
        process_group=0,  # Control-C is for the demo, which ends the rig in its own order
    )


def _end_of(name: str, code: int, talk: IO[bytes]) -> str:
    return f"the rig's {name} ended with exit code {code}: {_all_of(talk)[-2000:]}"


def _all_of(talk: IO[bytes]) -> str:
    # Without moving the position, at which the sensor writes.
    return os.pread(talk.fileno(), os.fstat(talk.fileno()).st_size, 0).decode(errors="replace").strip()
