"""A recording as an episode: a table and videos of its frames, and a JSON file about them."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from syncrelay.config import Config, LerobotConfig
from syncrelay.config.wording import counted
from syncrelay.errors import BagError, UsageError
from syncrelay.recordings.analysis.few_sets import why_few_sets
from syncrelay.recordings.bag import Recording, open_recording
from syncrelay.recordings.bag.bindings import GroupBinding, bind
from syncrelay.recordings.bag.replay import Replay
from syncrelay.recordings.datasets.lerobot.grid import Grid
from syncrelay.recordings.datasets.lerobot.sets import INCOMPLETE, FrameSet, FrameSets
from syncrelay.recordings.datasets.lerobot.stats import PictureStats, as_lists, stats_of
from syncrelay.recordings.datasets.lerobot.videos import VideoWriter
from syncrelay.recordings.datasets.reading import SetsOf, require_complete
from syncrelay.urls import redacted

TABLE: Final = "frames.parquet"
ABOUT: Final = "episode.json"
TASK: Final = "task"
"""The column of the table that says what the robot does."""


def video_of(folder: Path, feature: str) -> Path:
    """Return where an episode's video of a feature is."""
    return folder / f"{feature}.mp4"


def lerobot_of(config: Config) -> LerobotConfig:
    """Return `export: lerobot:` of a file; raises UsageError where it has none."""
    if config.lerobot is None:
        raise UsageError(
            "the file does not say what becomes a LeRobotDataset: write fps, task and features below `export:`"
            " `lerobot:`, as docs/howto/lerobot.md shows"
        )
    return config.lerobot


def write_episode(name: str, words: Sequence[str], config: Config, folder: Path) -> dict[str, Any]:
    """Write the episode of a recording into an empty folder, to be joined with others; return facts about it.

    `words` is what open_recording takes. The facts: the number of `frames`, and of those that repeat the set of the
    frame before (`held`); the number of sets that were `left_out` because others were nearer, and of those that were
    `unusable`, by reason; the longest time between a frame and its set (`farthest_ns`); and `problems`: a sentence for
    all that is missing or could not be read or decoded, and for what costs most of the possible frames.

    Raises UsageError where the file has no `export: lerobot:`, and BagError for a recording that cannot be an episode.
    """
    lerobot = lerobot_of(config)
    try:
        with closing(open_recording(words)) as recording:
            (binding,) = (each for each in bind(config, recording) if each.group.name == lerobot.group)
            require_complete([binding])
            return _write(lerobot, recording, binding, name, folder)
    except BagError as error:
        # A sentence about a topic does not name the recording.
        text, shown = str(error), redacted(words[0])
        raise BagError(text if text.startswith(shown) else f"{shown}: {text}") from error


def _write(
    lerobot: LerobotConfig, recording: Recording, binding: GroupBinding, name: str, folder: Path
) -> dict[str, Any]:
    sets = FrameSets(lerobot, binding)
    source = SetsOf([binding], sets.content, name=name)
    replay = Replay(recording, [binding], listeners=source.listeners)
    with ExitStack() as opened:
        episode = _Episode(lerobot, sets, folder, opened)
        for part in source.parts(replay.steps()):
            for each in sets.read(part.table):
                episode.add(each)
        episode.end()
    if recording.faults and not lerobot.keeps_incomplete:
        raise BagError(_incomplete(recording.faults))
    (result,) = replay.results()
    counts = [each.counts for each in result.inputs]
    few = why_few_sets(recording, binding, counts, sets.complete, needed=sets.needed)
    if not episode.grid.frames:
        raise BagError(few or _no_frames(result.sets, sets.unusable))
    facts = episode.write_table()
    return {**facts, "problems": [*recording.faults, *source.faults(), *_lost(few, sets)]}


def _lost(few: str | None, sets: FrameSets) -> Iterator[str]:
    """Yield a sentence for what costs most of the possible frames."""
    if few is not None:
        yield few
    spoilt = {why: count for why, count in sets.unusable.items() if count and why != INCOMPLETE}
    if 2 * sum(spoilt.values()) > sets.complete:
        reasons = ", ".join(f"{count} {why}" for why, count in spoilt.items())
        yield f"most of {counted(sets.complete, 'set')} cannot be frames: {reasons}"


class _Episode:
    """Gathers frames. Pictures are encoded as they come, vectors are kept."""

    def __init__(self, config: LerobotConfig, sets: FrameSets, folder: Path, opened: ExitStack) -> None:
        self.grid: Final = Grid(fps=config.fps, max_gap_ns=config.max_gap_ns)
        self._config = config
        self._sets = sets
        self._folder = folder
        self._pending: FrameSet | None = None
        self._tasks: list[str] = []
        self._rows: dict[str, list[np.ndarray[Any, Any]]] = {name: [] for name in sets.vectors}
        self._videos = {
            name: (opened.enter_context(VideoWriter(video_of(folder, name), fps=config.fps)), PictureStats())
            for name in sets.pictures
        }

    def add(self, found: FrameSet) -> None:
        """Add a set, which is later than those before."""
        self._show(self.grid.next_set(found.stamp))
        self._pending = found

    def end(self) -> None:
        """Show the last set."""
        self._show(self.grid.end())

    def _show(self, times: int) -> None:
        """Show the pending set in so many frames."""
        if not times or self._pending is None:
            return
        self._tasks += [self._pending.task] * times
        for rows, vector in zip(self._rows.values(), self._pending.vectors, strict=True):
            rows.extend([vector] * times)
        for (video, stats), pixels in zip(self._videos.values(), self._pending.pictures, strict=True):
            video.add(pixels, times)
            stats.add(pixels, times)

    def write_table(self) -> dict[str, Any]:
        """Write all but the videos, and return the facts."""
        vectors = {name: np.stack(rows) for name, rows in self._rows.items()}
        stats = {name: stats_of(rows) for name, rows in vectors.items()}
        stats |= {name: pictures.stats() for name, (_, pictures) in self._videos.items()}
        columns = {name: _column(rows) for name, rows in vectors.items()}
        columns[TASK] = pa.array(self._tasks, pa.string()).dictionary_encode()
        pq.write_table(pa.table(columns), self._folder / TABLE)
        facts = {
            "frames": self.grid.frames,
            "held": self.grid.held,
            "left_out": self.grid.left_out,
            "unusable": {why: count for why, count in self._sets.unusable.items() if count},
            "farthest_ns": self.grid.farthest_ns,
        }
        about = {"fps": self._config.fps, **facts, "features": self._sets.features(), "stats": as_lists(stats)}
        (self._folder / ABOUT).write_text(json.dumps(about), encoding="utf-8")
        return facts


def _column(rows: np.ndarray[Any, Any]) -> pa.Array:
    width = rows.shape[1]
    values = pa.array(rows.reshape(-1))
    # A vector of one value is a number in LeRobot's tables.
    return values if width == 1 else pa.FixedSizeListArray.from_arrays(values, width)


def _incomplete(faults: Sequence[str]) -> str:
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    return f"{faults[0]}{more}: no episode; write `incomplete: keep` below `lerobot:` to keep what can be read"


def _no_frames(count: int, unusable: Mapping[str, int]) -> str:
    if not count:
        return "the recording gives no set, so there is no frame: `syncrelay analyze` says why"
    reasons = ", ".join(f"{number} {why}" for why, number in unusable.items() if number)
    return f"none of {counted(count, 'set')} can be a frame: {reasons}"
