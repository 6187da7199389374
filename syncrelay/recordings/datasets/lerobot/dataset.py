"""Episodes joined to one LeRobotDataset: tables one behind another, videos without encoding them again."""

import json
import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from syncrelay.config import Config
from syncrelay.errors import BagError
from syncrelay.output_files import cannot_be_written
from syncrelay.recordings.datasets.lerobot import layout
from syncrelay.recordings.datasets.lerobot.episode import (
    ABOUT,
    TABLE,
    TASK,
    as_lists,
    lerobot_of,
    video_of,
    write_episode,
)
from syncrelay.recordings.datasets.lerobot.stats import Stats, stats_of, together
from syncrelay.recordings.datasets.lerobot.videos import JoinedVideo, described

_SCRATCH: Final = ".episodes"
# A row has some kilobytes of statistics.
_EPISODES_AT_ONCE: Final = 100
_MOST_MB: Final = {"data": layout.DATA_FILE_MB, "episodes": layout.DATA_FILE_MB, "video": layout.VIDEO_FILE_MB}


class NamedRecording(Protocol):
    """A recording: a name for it that any folder can hold, and what open_recording takes."""

    @property
    def name(self) -> str:
        """The name of its episode."""
        ...

    @property
    def words(self) -> tuple[str, ...]:
        """Paths or URLs."""
        ...


def write_lerobot(recordings: Sequence[NamedRecording], config: Config, folder: Path) -> dict[str, Any]:
    """Write recordings as one LeRobotDataset into an empty folder: an episode each, in their order; return facts.

    The facts are those of join_episodes, with those of write_episode in `episodes`. A recording that cannot be an
    episode is left out and told in `problems`.

    Raises UsageError where the file says nothing of LeRobot, BagError where no recording is left.
    """
    lerobot_of(config)
    scratch = folder / _SCRATCH
    episodes: dict[str, Path] = {}
    told: dict[str, Any] = {}
    problems: list[str] = []
    try:
        for each in recordings:
            place = scratch / each.name
            place.mkdir(parents=True)
            try:
                told[each.name] = facts = write_episode(each.name, each.words, config, place)
                episodes[each.name] = place
                problems += [f"{each.name}: {problem}" for problem in facts["problems"]]
            except BagError as error:
                problems.append(str(error))
        if not episodes:
            raise BagError("\n".join(problems) or "no recordings, expected one or more")
        facts = join_episodes(episodes, folder)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return {**facts, "episodes": told, "problems": [*problems, *facts["problems"]]}


def join_episodes(episodes: Mapping[str, Path], folder: Path) -> dict[str, Any]:
    """Join what write_episode wrote to one LeRobotDataset in a folder, in this order; return facts.

    The facts: `total_episodes`, `total_frames`, `total_tasks`, `held` and `left_out` as of write_episode, and
    `problems`, a sentence for each episode that has other features than the first and was left out. meta/info.json is
    written last. The same episodes give the same bytes. Raises OutputError where the folder cannot be written.
    """
    try:
        with ExitStack() as opened:
            dataset = _Dataset(folder, opened)
            for name, place in episodes.items():
                dataset.append(name, place)
            dataset.end()
        dataset.write_meta()
    except OSError as error:
        raise cannot_be_written(folder, error) from error
    return dataset.facts()


class _Dataset:
    """The files that are written, and what was counted."""

    def __init__(self, folder: Path, opened: ExitStack) -> None:
        self._data = _Tables(folder, layout.DATA, "data", opened)
        self._episodes = _Tables(folder, layout.EPISODES, "episodes", opened)
        self._videos: dict[str, _Videos] = {}
        self._folder = folder
        self._opened = opened
        self._first = ""
        self._about: dict[str, Any] = {}
        self._tasks: dict[str, int] = {}
        self._stats: dict[str, Stats] = {}
        self._rows: list[dict[str, Any]] = []
        self._problems: list[str] = []
        self._episode_count = 0
        self._frames = 0
        self._sums = {"held": 0, "left_out": 0}

    def append(self, name: str, place: Path) -> None:
        about = json.loads((place / ABOUT).read_text(encoding="utf-8"))
        if not self._about:
            self._first, self._about = name, about
            self._videos = {
                key: _Videos(self._folder, key, about["fps"], self._opened)
                for key, feature in about["features"].items()
                if feature["dtype"] == "video"
            }
        difference = _difference(about["features"], self._about["features"])
        if difference:
            self._problems.append(f"{name}: {difference}, as in {self._first}: it is left out")
            return
        table, tasks = self._numbered(pq.read_table(place / TABLE))
        count = len(table)
        stats = {key: {what: np.array(each) for what, each in of.items()} for key, of in about["stats"].items()}
        stats |= {key: stats_of(table[key].to_numpy()) for key in layout.COUNTERS}
        row: dict[str, Any] = {"episode_index": self._episode_count, "tasks": tasks, "length": count}
        row |= {f"data/{key}": index for key, index in self._data.write(table).items()}
        row |= {"dataset_from_index": self._frames, "dataset_to_index": self._frames + count}
        for key, videos in self._videos.items():
            row |= {f"videos/{key}/{what}": each for what, each in videos.append(video_of(place, key), count).items()}
        row |= {f"stats/{key}/{what}": each for key, of in as_lists(stats).items() for what, each in of.items()}
        self._rows.append(row)
        if len(self._rows) == _EPISODES_AT_ONCE:
            self.end()
        self._stats = {key: together(self._stats[key], of) if self._stats else of for key, of in stats.items()}
        self._sums = {key: number + about[key] for key, number in self._sums.items()}
        self._episode_count += 1
        self._frames += count

    def end(self) -> None:
        """Write the rows of episodes that are gathered."""
        if not self._rows:
            return
        table = pa.Table.from_pylist(self._rows)
        place = self._episodes.place_for(table)
        for key, index in place.items():
            table = table.append_column(f"meta/episodes/{key}", pa.array([index] * len(table), pa.int64()))
        self._episodes.write(table)
        self._rows = []

    def write_meta(self) -> None:
        """Write what is of all episodes."""
        pq.write_table(layout.tasks_table(list(self._tasks)), self._folder / layout.TASKS)
        _write_json(as_lists(self._stats), self._folder / layout.STATS)
        fps = self._about["fps"]
        features = {
            key: {**each, "info": described(each["shape"], fps=fps)} if key in self._videos else each
            for key, each in self._about["features"].items()
        }
        told = layout.info(
            fps=fps,
            features=features,
            episodes=self._episode_count,
            frames=self._frames,
            tasks=len(self._tasks),
            has_videos=bool(self._videos),
        )
        _write_json(told, self._folder / layout.INFO)

    def facts(self) -> dict[str, Any]:
        """Return what join_episodes does."""
        return {
            "total_episodes": self._episode_count,
            "total_frames": self._frames,
            "total_tasks": len(self._tasks),
            **self._sums,
            "problems": self._problems,
        }

    def _numbered(self, table: pa.Table) -> tuple[pa.Table, list[str]]:
        """Return an episode's table with its counters in place of its tasks' words, and the tasks."""
        words = table[TASK].combine_chunks().dictionary_decode()
        tasks: list[str] = pc.unique(words).to_pylist()
        for task in tasks:
            self._tasks.setdefault(task, len(self._tasks))
        frames = np.arange(len(table))
        counters = {
            "timestamp": (frames / self._about["fps"]).astype(np.float32),
            "frame_index": frames,
            "episode_index": np.full(len(table), self._episode_count),
            "index": frames + self._frames,
            "task_index": np.array([self._tasks[task] for task in words.to_pylist()]),
        }
        table = table.drop_columns([TASK])
        for name, values in counters.items():
            table = table.append_column(name, pa.array(values))
        return table, tasks


class _Tables:
    """Parquet files of one kind, each of bounded size."""

    def __init__(self, folder: Path, pattern: str, kind: str, opened: ExitStack) -> None:
        self._folder = folder
        self._pattern = pattern
        self._rolling = layout.Rolling(_MOST_MB[kind])
        self._opened = opened
        self._writer: pq.ParquetWriter | None = None

    def place_for(self, table: pa.Table) -> dict[str, int]:
        """Return the indices of the file that a table belongs in."""
        if self._rolling.would_roll(table.nbytes):
            self._rolling.roll()
            if self._writer is not None:
                self._writer.close()
            self._writer = None
        return {"chunk_index": self._rolling.chunk, "file_index": self._rolling.file}

    def write(self, table: pa.Table) -> dict[str, int]:
        """Write a table as one row group, and return the indices of its file."""
        place = self.place_for(table)
        if self._writer is None:
            path = self._folder / self._rolling.path(self._pattern)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = self._opened.enter_context(pq.ParquetWriter(path, table.schema, compression="snappy"))
        self._writer.write_table(table, row_group_size=len(table))
        self._rolling.size += table.nbytes
        return place


class _Videos:
    """Files of one feature's video, each of bounded size."""

    def __init__(self, folder: Path, key: str, fps: int, opened: ExitStack) -> None:
        self._folder = folder
        self._key = key
        self._fps = fps
        self._rolling = layout.Rolling(_MOST_MB["video"])
        self._opened = opened
        self._stack: ExitStack | None = None
        self._video: JoinedVideo | None = None

    def append(self, path: Path, frames: int) -> dict[str, Any]:
        """Append an episode's video; return where it stands."""
        size = path.stat().st_size
        if self._rolling.would_roll(size):
            self._rolling.roll()
            self._video = None
        if self._video is None:
            if self._stack is not None:
                self._stack.close()
            self._stack = self._opened.enter_context(ExitStack())
            into = self._folder / self._rolling.path(layout.VIDEO, video_key=self._key)
            self._video = self._stack.enter_context(JoinedVideo(into, fps=self._fps))
        before = self._video.frames
        self._video.append(path, frames)
        self._rolling.size += size
        return {
            "chunk_index": self._rolling.chunk,
            "file_index": self._rolling.file,
            "from_timestamp": before / self._fps,
            "to_timestamp": self._video.frames / self._fps,
        }


def _difference(features: Mapping[str, Any], expected: Mapping[str, Any]) -> str:
    """Say what is other in an episode's features than in the first's; nothing where all is the same."""
    for key, each in expected.items():
        found = features[key]
        if found["shape"] != each["shape"]:
            return f"{key} has the shape {found['shape']}, expected {each['shape']}"
        if found["names"] != each["names"]:
            return f"{key} has {', '.join(found['names'])}, expected {', '.join(each['names'])}"
    return ""


def _write_json(value: object, path: Path) -> None:
    path.write_text(json.dumps(value, indent=4, ensure_ascii=False), encoding="utf-8")
