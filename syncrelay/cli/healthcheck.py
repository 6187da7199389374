"""A relay's heartbeat: a file that its receive loop writes the time into, and `syncrelay healthcheck`, which reads it.

The check needs the standard library only: `python3 -I -S healthcheck.py` skips what the ROS wheels do whenever Python
starts. Times are those of the machine's monotonic clock, which its containers share.
"""

import os
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Callable

    from syncrelay.cli.parser import Parser
    from syncrelay.cli.stop import StopRequest

VARIABLE: Final = "SYNCRELAY_HEARTBEAT"
"""The environment variable that names the file; without it there is no heartbeat."""

_PERIOD_NS: Final = 500_000_000
# An idle loop turns once a second; one that has not turned for this long is taken to hang.
_STALE_NS: Final = 5_000_000_000


class Heartbeat:
    """Writes the time into a file, at most twice a second; a context manager that removes the file when it ends."""

    def __init__(self, path: Path, *, now: "Callable[[], int]" = time.monotonic_ns) -> None:
        """Create the file, empty until the first beat; raises OSError if it cannot be created."""
        self._now = now
        self._path = path
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)
        self._due = 0
        self._is_refused = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._path.unlink(missing_ok=True)
        os.close(self._file)

    def beat(self) -> None:
        """Note that the loop has turned."""
        now = self._now()
        if now >= self._due:
            self._due = now + _PERIOD_NS
            # A single write of fixed length: a reader sees the old time or the new one, never a mix.
            try:
                os.pwrite(self._file, b"%020d\n" % now, 0)
            except OSError as error:
                self._refuse(error)
            else:
                self._is_refused = False

    def _refuse(self, error: OSError) -> None:
        """Say once that the time cannot be written, as on a full disk: the check fails then, and nothing else."""
        if not self._is_refused:
            from syncrelay.logs import LOGGER

            self._is_refused = True
            LOGGER.warning("the heartbeat %s cannot be written: %s; trying again", self._path, error.strerror)


def ailment(path: Path) -> str | None:
    """Return what is wrong with the relay that writes this file; None if it is receiving."""
    try:
        written = path.read_bytes()
    except OSError as error:
        return f"no relay is running, or it cannot write its heartbeat: {path}: {error.strerror}"
    if not written:
        return "the relay is not receiving yet"
    try:
        age = time.monotonic_ns() - int(written)
    except ValueError:
        return f"{path} is not a heartbeat of syncrelay"
    if 0 <= age <= _STALE_NS:
        return None
    return f"the receive loop last turned {age / 1e9:.0f} s ago" if age > 0 else "the heartbeat is from an earlier run"


def parser() -> "Parser":
    from syncrelay.cli.parser import Parser

    return Parser(
        "syncrelay healthcheck",
        example=f"{VARIABLE}=/run/syncrelay/heartbeat syncrelay healthcheck",
        description=f"Checks that the relay is receiving: the relay writes a heartbeat into the file that {VARIABLE} "
        "names. Exit code 1 if it is not receiving.",
    )


def command(_parser: "Parser", _arguments: "Namespace", _stop: "StopRequest") -> int:
    return healthcheck()


def healthcheck() -> int:
    """Print what is wrong, if anything is; 0 if the relay is receiving, 1 if not."""
    named = os.environ.get(VARIABLE)
    found = ailment(Path(named)) if named else f"{VARIABLE} is not set: it must name the heartbeat file"
    print(found or "receiving")  # noqa: T201  Docker stores it with the result
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(healthcheck())
