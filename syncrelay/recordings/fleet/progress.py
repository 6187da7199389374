"""How far a run has come, how fast it goes, and how long it will still take, as far as that can be known."""

from dataclasses import dataclass
from typing import Final

from syncrelay.config.wording import counted
from syncrelay.recordings.fleet.engine import Finished
from syncrelay.recordings.fleet.work import Failed, Job, Kept

# Before, a rate is that of a few recordings that happened to be first.
_LEAST_S: Final = 5
_LEAST_RECORDINGS: Final = 4
_LEAST_SHARE: Final = 0.02
_MEGA: Final = 1_000_000
_MINUTE: Final = 60
_HOUR: Final = 3600


@dataclass(slots=True)
class Progress:
    """Counts the recordings of a run as they end. Times are seconds of one clock; bytes are those of recordings."""

    jobs: tuple[Job, ...]
    begun: float
    done: int = 0
    kept: int = 0
    failed: int = 0
    _bytes_read: int = 0
    """Of recordings that were not found done."""
    _bytes_left: int = 0
    _unknown_left: int = 0
    """Recordings to come of which the size is not known."""

    def __post_init__(self) -> None:
        # What the ledger has is most likely there, and looked at much faster than done.
        ahead = [job for job in self.jobs if job.done is None]
        self._bytes_left = sum(job.size for job in ahead)
        self._unknown_left = sum(not job.size for job in ahead)

    def take(self, finished: Finished) -> None:
        """Count a recording that has ended."""
        job, outcome = finished
        if job.done is None:
            self._bytes_left -= job.size
            self._unknown_left -= not job.size
        match outcome:
            case Kept():
                self.kept += 1
                return
            case Failed():
                self.failed += 1
            case _:
                self.done += 1
        self._bytes_read += job.size

    def line(self, now: float) -> str:
        """Return the state as a line."""
        ended = self.done + self.kept + self.failed
        parts = [f"{ended} of {counted(len(self.jobs), 'recording')}"]
        if self.kept:
            parts.append(f"{self.kept} were done before")
        if self.failed:
            parts.append(f"{self.failed} failed")
        elapsed = now - self.begun
        if self._bytes_read and elapsed > 0:
            parts.append(f"{self._bytes_read / elapsed / _MEGA:.0f} MB/s")
        if (left := self._left(elapsed)) is not None:
            parts.append(f"about {_duration(left)} left")
        return ", ".join(parts)

    def _left(self, elapsed: float) -> float | None:
        """Return how many seconds are left, None where nothing shows it yet."""
        whole = self._bytes_read + self._bytes_left
        few = self.done + self.failed < _LEAST_RECORDINGS or self._bytes_read < _LEAST_SHARE * whole
        if elapsed < _LEAST_S or few or self._unknown_left or not self._bytes_left:
            return None
        return self._bytes_left * elapsed / self._bytes_read


def _duration(seconds: float) -> str:
    if seconds < _MINUTE:
        return f"{max(1, round(seconds))} s"
    if seconds < _HOUR:
        return f"{round(seconds / _MINUTE)} min"
    return f"{seconds / _HOUR:.1f} h"
