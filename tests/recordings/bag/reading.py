"""Recordings as tests read them: all of their messages as frames, or bound to the groups of a file."""

import resource
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import NamedTuple

from syncrelay.config import load_text
from syncrelay.recordings.bag import Recording, open_recording
from syncrelay.recordings.bag.bindings import GroupBinding, bind
from syncrelay.recordings.bag.replay import Left, Listener
from syncrelay.sync import Outcome
from syncrelay.urls import redacted
from tests.ros.frames import Frame


class Read(NamedTuple):
    """The messages of a recording, what is wrong with it, and what is remarked."""

    frames: list[Frame]
    faults: list[str]
    told: list[str]


def read(*words: Path | str, topics: set[str] | None = None) -> Read:
    """Read some topics or all of them; faults are told without the name of the first file."""
    told: list[str] = []
    name = f"{redacted(str(words[0]))}: "
    with closing(open_recording([str(word) for word in words], tell=told.append)) as recording:
        wanted = [each for each in recording.channels if topics is None or each.topic in topics]
        frames, positions = [], [0]
        for batch in recording.batches(wanted):
            frames += [Frame(each.topic, each.type, time, payload) for each, time, payload in batch]
            positions.append(recording.position)
        assert all(positions[1:])
        assert [*positions, recording.size] == sorted([*positions, recording.position])
        return Read(frames, [fault.removeprefix(name) for fault in recording.faults], told)


@contextmanager
def bound(*words: Path | str, text: str) -> Iterator[tuple[Recording, tuple[GroupBinding, ...]]]:
    """Open a recording, with the groups of a file's text as it fills them."""
    with closing(open_recording([str(word) for word in words])) as recording:
        yield recording, bind(load_text(text), recording)


def one_by_one(note: Callable[[GroupBinding, Outcome, int], object]) -> Listener:
    """Return a listener of a replay that notes each set and drop."""

    def listen(left: Sequence[Left]) -> None:
        for binding, outcomes, now in left:
            for outcome in outcomes:
                note(binding, outcome, now)

    return listen


@contextmanager
def full_disk() -> Iterator[None]:
    """As on a disk whose quota is used up: the system refuses to write more than 1000 bytes of a file."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
