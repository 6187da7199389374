"""`export --format lerobot`: an episode of each recording, as the fleet's results, then one dataset of all."""

import shutil
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Final, Self
from uuid import uuid4

from syncrelay.cli.boundary import AT_FAULT, DONE, put, remark
from syncrelay.cli.fleet import do_on_many
from syncrelay.cli.reading import eased_collector
from syncrelay.config import Config
from syncrelay.config.wording import counted
from syncrelay.errors import SyncRelayError
from syncrelay.printable import printable
from syncrelay.recordings.datasets.lerobot import join_episodes, lerobot_of, write_episode
from syncrelay.recordings.fleet.ledger import State
from syncrelay.recordings.fleet.run import Run
from syncrelay.recordings.fleet.task import JSON, Source, fingerprint_of, what_decides_sets
from syncrelay.recordings.fleet.work import SCRATCH

EPISODES: Final = ".episodes"
"""The folder in OUT with each recording's episode, so that only what is missing is done again."""

# What readers look at first is there last, and goes first.
_PARTS: Final = ("data", "videos", "meta")


def export_lerobot(config: Config, bags: Sequence[str], arguments: Namespace) -> int:
    """Write a LeRobotDataset of all recordings that `bags` name into the folder of the arguments; return the exit code.

    Raises UsageError where the file says nothing of LeRobot, SyncRelayError where the folder holds something else.
    """
    task = LerobotTask.of(config)
    # In a worker it would be a bug.
    for module in ("av", "PIL.Image", "pyarrow"):
        import_module(module)
    out = Path(arguments.into).absolute()
    _require_own(out)
    into = out / EPISODES
    chosen = Namespace(**{**vars(arguments), "into": str(into)})
    return do_on_many(task, bags, chosen, finish=lambda run, sources: _join(run, sources, out))


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


def _require_own(out: Path) -> None:
    try:
        is_other = out.exists() and not (out / EPISODES).is_dir() and any(out.iterdir())
    except OSError as error:
        raise SyncRelayError(f"{out}: cannot be read: {error.strerror}") from error
    if is_other:
        raise SyncRelayError(f"{out}: holds something else: name another folder, or an empty one")


def _join(run: Run, sources: Sequence[Source], out: Path) -> int:
    """Put the dataset of all episodes in place, in the order of the recordings, and say what it has."""
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
    for problem in facts["problems"]:
        remark(problem)
    episodes, frames = counted(facts["total_episodes"], "episode"), counted(facts["total_frames"], "frame")
    held, left_out = counted(facts["held"], "frame"), counted(facts["left_out"], "set")
    put(printable(f"{out}: {episodes} with {frames}; {held} repeated, {left_out} between frames left out"))
    return AT_FAULT if facts["problems"] else DONE
