"""What `export` does with each recording: a Parquet file for each group, or an episode of a LeRobotDataset."""

import shutil
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self
from uuid import uuid4

from syncrelay.collector import eased_collector
from syncrelay.config import Config
from syncrelay.errors import SyncRelayError
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import bind
from syncrelay.recordings.bag.replay import Replay
from syncrelay.recordings.datasets.lerobot import join_episodes, lerobot_of, write_episode
from syncrelay.recordings.datasets.parquet import write_parquet
from syncrelay.recordings.datasets.reading import SetsOf
from syncrelay.recordings.datasets.tables import Content
from syncrelay.recordings.fleet.job import SCRATCH
from syncrelay.recordings.fleet.ledger import State
from syncrelay.recordings.fleet.run import Run
from syncrelay.recordings.fleet.task import JSON, Source, fingerprint_of, what_decides_sets
from syncrelay.recordings.fleet.tasks import about, counts_of, few_sets

EPISODES: Final = ".episodes"
"""The folder in OUT that keeps the episode of each recording, so that only what is missing is done again."""

# Readers look at the last of these first: it is removed first, and put in place last.
_PARTS: Final = ("data", "videos", "meta")


@dataclass(frozen=True, slots=True)
class ParquetTask:
    """Writes the sets of a recording as a Parquet file for each group; see Task. Facts are the counts of each input."""

    config: Config
    content: Content
    fingerprint: str

    @classmethod
    def of(cls, config: Config, content: Content) -> Self:
        """Return the task of a file."""
        options: dict[str, JSON] = {
            "format": "parquet",
            "groups": [group.name for group in config.groups],
            "fields": {topic: list(paths) for topic, paths in content.fields.items()},
            "images": dict(content.images),
            "other_images": content.other_images,
            "raw": content.raw,
            "compression": content.compression,
        }
        fingerprint = fingerprint_of("export", config=what_decides_sets(config.groups), options=options)
        return cls(config, content, fingerprint)

    def run(self, source: Source, folder: Path) -> dict[str, JSON]:
        """See Task."""
        with closing(open_recording([source.place])) as recording, eased_collector():
            bindings = bind(self.config, recording)
            sets = SetsOf(bindings, self.content, name=source.name)
            replay = Replay(recording, bindings, listeners=sets.listeners)
            write_parquet(sets, replay.steps(), folder, compression=self.content.compression)
            results = replay.results()
            facts = {**about(recording, bindings, more=sets.faults()), **few_sets(recording, bindings, results)}
            return {**facts, "groups": [counts_of(result) for result in results]}


@dataclass(frozen=True, slots=True)
class LerobotTask:
    """Writes a recording as an episode; see Task. Facts are those of write_episode."""

    config: Config
    fingerprint: str

    @classmethod
    def of(cls, config: Config) -> Self:
        """Return the task of a file; raises UsageError if it says nothing about LeRobot."""
        lerobot = lerobot_of(config)
        chosen = [group for group in config.groups if group.name == lerobot.group]
        options: dict[str, JSON] = {"format": "lerobot", "lerobot": repr(lerobot)}
        return cls(config, fingerprint_of("export", config=what_decides_sets(chosen), options=options))

    def run(self, source: Source, folder: Path) -> dict[str, JSON]:
        """See Task."""
        with eased_collector():
            return write_episode(source.name, [source.place], self.config, folder)


def require_own(out: Path) -> None:
    """Raise SyncRelayError if a folder holds anything but an earlier dataset of ours."""
    try:
        is_other = out.exists() and not (out / EPISODES).is_dir() and any(out.iterdir())
    except OSError as error:
        raise SyncRelayError(f"{out}: cannot be read: {error.strerror}") from error
    if is_other:
        raise SyncRelayError(f"{out}: holds something else: name another folder, or an empty one")


def join(run: Run, sources: Sequence[Source], out: Path) -> dict[str, Any]:
    """Put the dataset of all episodes in place, in the order of the recordings, and return what it has.

    Raises SyncRelayError if no recording gave an episode.
    """
    entries = {job.source.name: run.entry(job) for job in run.jobs}
    ordered = [entries[source.name] for source in sources]
    done = [entry.name for entry in ordered if entry is not None and entry.state is State.DONE]
    into = out / EPISODES
    if not done:
        raise SyncRelayError(f"{out}: no recording gave an episode, so there is no dataset")
    scratch = into / SCRATCH / f"dataset.{uuid4().hex}"
    scratch.mkdir(parents=True)
    facts = join_episodes({name: into / name for name in done}, scratch)
    for part in reversed(_PARTS):
        shutil.rmtree(out / part, ignore_errors=True)
    for part in _PARTS:
        if (scratch / part).exists():
            (scratch / part).rename(out / part)
    return facts
