"""What works on the recordings: one protocol, for this machine's cores and for a Ray cluster."""

from collections.abc import Generator, Iterable
from typing import Final, NamedTuple, Protocol

from syncrelay.recordings.fleet.work import Job, Outcome

TICK_S: Final = 0.2
"""An engine tells that nothing happened as often as this, so that a signal is seen and progress is shown."""

TRIES: Final = 3
"""How often a job is begun whose worker dies."""


class Finished(NamedTuple):
    """A job that has come to its end."""

    job: Job
    outcome: Outcome


class Engine(Protocol):
    """Does jobs, several at a time and in any order."""

    def run(self, jobs: Iterable[Job | None]) -> Generator[Finished | None, None, None]:
        """Yield each job when it has ended, and None at least every TICK_S; jobs are taken as there is room for them.

        None among the jobs says that the next one depends on those that are at work. To close the generator ends all
        that is at work. A worker that dies costs its own job a try and no other's.
        """
        ...


def took_too_long(job: Job) -> str:
    """Return the sentence for a job that was ended because of its time."""
    limit = "10 min and 10 s for each MB" if job.time_limit is None else f"{job.time_limit / 10**9:g} s"
    return f"{job.source.shown[0]}: not done within {limit}: check it, or give it longer by --time-limit"


def given_up(job: Job, why: str) -> str:
    """Return the sentence for a job whose workers died."""
    return f"{job.source.shown[0]}: {why} {TRIES} times: check whether there is enough memory, or use fewer --jobs"
