"""The sign of life of a relay: a file that its receive loop writes the time into, and a probe that reads it.

The probe is the standard library's alone, so that `python3 -I -S heartbeat.py` can skip what the ROS wheels do at
every start of Python. Times are those of the machine's monotonic clock, which its containers share.
"""

import os
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Final, Self

VARIABLE: Final = "SYNCRELAY_HEARTBEAT"
"""The environment variable that names the file; without it there is no heartbeat."""

_PERIOD_NS: Final = 500_000_000
# The loop turns once a second when idle. A stall of this length has no other cause than that it hangs.
_STALE_NS: Final = 5_000_000_000


class Heartbeat:
    """Writes the time into a file, at most twice a second; a context manager that removes the file at its end."""

    def __init__(self, path: Path) -> None:
        """Make the file, empty until the first beat. Raises OSError where that cannot be done."""
        self._path = path
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)
        self._due = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._path.unlink(missing_ok=True)
        os.close(self._file)

    def beat(self) -> None:
        """Say that the loop turned."""
        now = time.monotonic_ns()
        if now >= self._due:
            self._due = now + _PERIOD_NS
            # One write of one length at one place: a reader finds the old time or the new one.
            os.pwrite(self._file, b"%020d\n" % now, 0)


def ailment(path: Path) -> str | None:
    """Return what is wrong with the relay that beats in this file, None if nothing is."""
    try:
        written = path.read_bytes()
    except OSError as error:
        return f"no relay runs, or it cannot write its heartbeat: {path}: {error.strerror}"
    if not written:
        return "the relay has not begun to receive yet"
    age = time.monotonic_ns() - int(written)
    if 0 <= age <= _STALE_NS:
        return None
    return f"the receive loop last turned {age / 1e9:.0f} s ago" if age > 0 else "the heartbeat is of an earlier run"


def healthcheck() -> int:
    """Print what is wrong, if anything is; 0 if the relay receives, 1 if not."""
    named = os.environ.get(VARIABLE)
    found = ailment(Path(named)) if named else f"{VARIABLE} does not name the heartbeat's file"
    print(found or "receiving")  # noqa: T201  Docker keeps it with the result
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(healthcheck())
