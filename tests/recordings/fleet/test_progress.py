"""What is said while a run goes on: counts, the rate, and what is left as soon as that can be known."""

from pathlib import Path

import pytest

from syncrelay.recordings.fleet.content import Content
from syncrelay.recordings.fleet.job import Done, Failed, Finished, Job, Kept
from syncrelay.recordings.fleet.ledger import Entry, State
from syncrelay.recordings.fleet.progress import Progress
from syncrelay.recordings.fleet.task import Source
from tests.recordings.fleet.tasks import Obedient

_DONE = Done(Content("", 0, ()), {}, {}, Path())


def jobs(*sizes, done=()):
    entry = Entry("", State.DONE, "", "")
    return tuple(
        Job(Source(str(n), ""), Obedient(), Path(), entry if n in done else None, size, "")
        for n, size in enumerate(sizes)
    )


def progress(all_jobs, outcomes):
    shown = Progress(all_jobs, begun=100.0)
    for job, outcome in zip(all_jobs, outcomes, strict=False):
        shown.take(Finished(job, outcome))
    return shown


def test_it_counts():
    shown = progress(jobs(*[10**6] * 9, done=(0,)), [Kept(), _DONE, Failed("")])
    assert shown.line(102.0) == "3 of 9 recordings, 1 done before, 1 failed, 1 MB/s"


def test_what_is_left_goes_by_bytes():
    # A tenth of the recordings, half of the bytes.
    sizes = [*[90 * 10**6] * 5, *[10 * 10**6] * 45]
    assert progress(jobs(*sizes), [_DONE] * 5).line(160.0) == "5 of 50 recordings, 8 MB/s, about 1 min left"


def test_recordings_that_were_done_before_are_no_measure_of_those_to_come():
    shown = progress(jobs(*[10**9] * 10, done=range(5)), [*[Kept()] * 5, *[_DONE] * 4])
    assert shown.line(140.0).endswith("100 MB/s, about 10 s left")


@pytest.mark.parametrize(
    ("sizes", "count", "now"),
    [
        ([10**6] * 100, 3, 160.0),
        ([10**6] * 100, 50, 104.0),
        ([*[10**3] * 50, *[10**9] * 50], 50, 160.0),
        ([*[10**6] * 50, *[0] * 50], 50, 160.0),
    ],
    ids=["few recordings", "just begun", "few bytes", "sizes that are not known"],
)
def test_nothing_is_said_of_what_cannot_be_known_yet(sizes, count, now):
    assert "left" not in progress(jobs(*sizes), [_DONE] * count).line(now)
