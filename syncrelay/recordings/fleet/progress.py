"""How far a run has come, how fast it goes, and how long it will still take, as soon as that can be known."""

from dataclasses import dataclass
from typing import Final

from syncrelay.config.wording import counted
from syncrelay.recordings.fleet.job import Failed, Finished, Job, Kept

# Before that, the rate is that of the few recordings that happen to be first.
_LEAST_S: Final = 5
_LEAST_RECORDINGS: Final = 4
_LEAST_SHARE: Final = 0.02
_MEGA: Final = 1_000_000
_MINUTE: Final = 60
_HOUR: Final = 3600


@dataclass(slots=True)
class Progress:
    """Counts the recordings of a run as they end. Times are seconds of one clock."""

    jobs: tuple[Job, ...]
    begun: float
    done: int = 0
    kept: int = 0
    failed: int = 0
    faulty: int = 0
    """Recordings that were done although something is wrong with them."""
    _bytes_read: int = 0
    """Size of the recordings that were done anew."""
    _bytes_left: int = 0
    _unknown_left: int = 0
    """Recordings left whose size is not known."""

    def __post_init__(self) -> None:
        # A recording with an entry in the ledger is most likely kept, which takes little time.
        ahead = [job for job in self.jobs if job.done is None]
        self._bytes_left = sum(job.size for job in ahead)
        self._unknown_left = sum(not job.size for job in ahead)

    def take(self, finished: Finished) -> None:
        """Count a recording that has ended."""
        job, outcome = finished
        if job.done is None:
            self._bytes_left -= job.size
            self._unknown_left -= not job.size
        if isinstance(outcome, Kept):
            self.kept += 1
            return
        if isinstance(outcome, Failed):
            self.failed += 1
        else:
            self.done += 1
        self._bytes_read += job.size

    def line(self, now: float) -> str:
        """Return the state as a line, while the run goes on."""
        ended = self.done + self.kept + self.failed
        parts = [f"{ended} of {counted(len(self.jobs), 'recording')}"]
        if self.kept:
            parts.append(f"{self.kept} done before")
        if self.failed:
            parts.append(f"{self.failed} failed")
        elapsed = now - self.begun
        if self._bytes_read and elapsed > 0:
            parts.append(f"{self._bytes_read / elapsed / _MEGA:.0f} MB/s")
        if (left := self._left(elapsed)) is not None:
            parts.append(f"about {_duration(left)} left")
        return ", ".join(parts)

    def summary(self) -> str:
        """Return what came of the recordings, when the run has ended."""
        missing = len(self.jobs) - self.done - self.kept - self.failed
        counts = {"done": self.done, "done before": self.kept, "failed": self.failed, "not done": missing}
        ended = ", ".join(f"{count} {what}" for what, count in counts.items() if count)
        faulty = f"; {self.faulty} with problems" if self.faulty else ""
        return f"{counted(len(self.jobs), 'recording')}: {ended}{faulty}"

    def _left(self, elapsed: float) -> float | None:
        """Return how many seconds are left, None while that cannot be known."""
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
