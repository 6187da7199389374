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
"""The folder in OUT with each recording's episode, so that only what is missing is done again."""

# What readers look at first is there last, and goes first.
_PARTS: Final = ("data", "videos", "meta")


@dataclass(frozen=True, slots=True)
class ParquetTask:
    """Writes the sets of a recording as a Parquet file for each group; see Task. Facts are the counts of each input."""

    config: Config
    content: Content
    decided_by: str

    @classmethod
    def of(cls, config: Config, content: Content) -> Self:
        """Return the task of a file."""
        fields: dict[str, JSON] = {topic: list(paths) for topic, paths in content.fields.items()}
        groups: list[JSON] = [group.name for group in config.groups]
        options: dict[str, JSON] = {
            "format": "parquet",
            "groups": groups,
            "fields": fields,
            "images": dict(content.images),
            "other_images": content.other_images,
            "raw": content.raw,
        }
        return cls(
            config,
            content,
            fingerprint_of("export", config=what_decides_sets(config.groups), options=options),
        )

    def fingerprint(self) -> str:
        """See Task."""
        return self.decided_by

    def run(self, source: Source, folder: Path) -> dict[str, JSON]:
        """See Task."""
        with closing(open_recording(source.words)) as recording, eased_collector():
            bindings = bind(self.config, recording)
            sets = SetsOf(bindings, self.content, name=source.name)
            replay = Replay(recording, bindings, listeners=sets.listeners)
            write_parquet(sets, replay.steps(), folder)
            results = replay.results()
            facts = {**about(recording, bindings, more=sets.faults()), **few_sets(recording, bindings, results)}
            return {**facts, "groups": [counts_of(result) for result in results]}


@dataclass(frozen=True, slots=True)
class LerobotTask:
    """Writes a recording as an episode; see Task. Facts are those of write_episode."""

    config: Config
    decided_by: str

    @classmethod
    def of(cls, config: Config) -> Self:
        """Return the task of a file; raises UsageError where it says nothing of LeRobot."""
        lerobot = lerobot_of(config)
        chosen = [group for group in config.groups if group.name == lerobot.group]
        options: dict[str, JSON] = {"format": "lerobot", "lerobot": repr(lerobot)}
        return cls(config, fingerprint_of("export", config=what_decides_sets(chosen), options=options))

    def fingerprint(self) -> str:
        """See Task."""
        return self.decided_by

    def run(self, source: Source, folder: Path) -> dict[str, JSON]:
        """See Task."""
        with eased_collector():
            return write_episode(source.name, source.words, self.config, folder)


def require_own(out: Path) -> None:
    """Raise SyncRelayError where a folder holds anything but a former dataset of ours."""
    try:
        is_other = out.exists() and not (out / EPISODES).is_dir() and any(out.iterdir())
    except OSError as error:
        raise SyncRelayError(f"{out}: cannot be read: {error.strerror}") from error
    if is_other:
        raise SyncRelayError(f"{out}: holds something else: name another folder, or an empty one")


def join(run: Run, sources: Sequence[Source], out: Path) -> dict[str, Any]:
    """Put the dataset of all episodes in place, in the order of the recordings, and return what it has.

    Raises SyncRelayError where no recording gave an episode.
    """
    entries = {job.source.name: run.entry(job) for job in run.jobs}
    into = out / EPISODES
    done = [
        entry
        for entry in (entries[source.name] for source in sources)
        if entry is not None and entry.state is State.DONE
    ]
    if not done:
        raise SyncRelayError(f"{out}: no recording gave an episode, so there is no dataset")
    scratch = into / SCRATCH / f"dataset.{uuid4().hex}"
    scratch.mkdir(parents=True)
    facts = join_episodes({entry.name: into / entry.name for entry in done}, scratch)
    for part in reversed(_PARTS):
        shutil.rmtree(out / part, ignore_errors=True)
    for part in _PARTS:
        if (scratch / part).exists():
            (scratch / part).rename(out / part)
    return facts
