"""Episodes joined to one LeRobotDataset: tables are written one after another, videos are not encoded again."""

import json
from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from syncrelay.output_files import cannot_be_written
from syncrelay.recordings.datasets.lerobot import layout
from syncrelay.recordings.datasets.lerobot.episode import ABOUT, TABLE, TASK, video_of
from syncrelay.recordings.datasets.lerobot.layout import RollingFiles
from syncrelay.recordings.datasets.lerobot.stats import Stats, as_lists, stats_of, together
from syncrelay.recordings.datasets.lerobot.videos import JoinedVideo, described

# A row has some kilobytes of statistics.
_EPISODES_AT_ONCE: Final = 100


def join_episodes(episodes: Mapping[str, Path], folder: Path) -> dict[str, Any]:
    """Join the folders that write_episode wrote to one LeRobotDataset, in this order; return facts.

    The facts: `total_episodes`, `total_frames`, `total_tasks`, the sums of `held` and `left_out` (see write_episode),
    and `problems`: a sentence for each episode that was left out because its features differ from the first's.
    meta/info.json is written last. The same episodes give the same bytes. Raises OutputError where the folder cannot
    be written.
    """
    try:
        with ExitStack() as opened:
            dataset = _Dataset(folder, opened)
            for name, place in episodes.items():
                dataset.append(name, place)
            dataset.write_episodes()
        dataset.write_meta()
    except OSError as error:
        raise cannot_be_written(folder, error) from error
    return dataset.facts()


class _Dataset:
    """A dataset that episodes are appended to."""

    def __init__(self, folder: Path, opened: ExitStack) -> None:
        self._folder = folder
        self._opened = opened
        self._data = self._tables(layout.DATA, "data")
        self._episodes = self._tables(layout.EPISODES, "episodes")
        self._videos: dict[str, RollingFiles[JoinedVideo, Path]] = {}
        self._first = ""
        self._about: dict[str, Any] = {}
        self._tasks: dict[str, int] = {}
        self._stats: dict[str, Stats] = {}
        self._rows: list[dict[str, Any]] = []
        self._problems: list[str] = []
        self._episode_count = 0
        self._frames = 0
        self._sums: Counter[str] = Counter(held=0, left_out=0)

    def append(self, name: str, place: Path) -> None:
        """Append an episode, if it has the features of the first one."""
        about = json.loads((place / ABOUT).read_text(encoding="utf-8"))
        if not self._about:
            self._first, self._about = name, about
            self._videos = {key: self._video_files(key) for key, of in about["features"].items() if _is_video(of)}
        difference = _difference(about["features"], self._about["features"])
        if difference:
            self._problems.append(f"{name}: {difference}, as in {self._first}: it is left out")
            return
        table, tasks = self._numbered(pq.read_table(place / TABLE))
        count = len(table)
        stats = {key: {what: np.array(each) for what, each in of.items()} for key, of in about["stats"].items()}
        stats |= {key: stats_of(table[key].to_numpy()) for key in layout.COUNTERS}
        row: dict[str, Any] = {"episode_index": self._episode_count, "tasks": tasks, "length": count}
        row |= {f"data/{key}": index for key, index in self._data.place_for(table.nbytes).items()}
        self._data.file_for(table, table.nbytes).write_table(table, row_group_size=count)
        row |= {"dataset_from_index": self._frames, "dataset_to_index": self._frames + count}
        for key in self._videos:
            video = self._appended_video(key, video_of(place, key), count)
            row |= {f"videos/{key}/{what}": each for what, each in video.items()}
        row |= {f"stats/{key}/{what}": each for key, of in as_lists(stats).items() for what, each in of.items()}
        self._rows.append(row)
        if len(self._rows) == _EPISODES_AT_ONCE:
            self.write_episodes()
        self._stats = {key: together(self._stats[key], of) if self._stats else of for key, of in stats.items()}
        self._sums.update({key: about[key] for key in self._sums})
        self._episode_count += 1
        self._frames += count

    def write_episodes(self) -> None:
        """Write the rows about episodes that have been gathered."""
        if not self._rows:
            return
        table = pa.Table.from_pylist(self._rows)
        size = table.nbytes
        for key, index in self._episodes.place_for(size).items():
            table = table.append_column(f"meta/episodes/{key}", pa.array([index] * len(table), pa.int64()))
        self._episodes.file_for(table, size).write_table(table)
        self._rows = []

    def write_meta(self) -> None:
        """Write the files about all episodes."""
        pq.write_table(layout.tasks_table(list(self._tasks)), self._folder / layout.TASKS)
        _write_json(as_lists(self._stats), self._folder / layout.STATS)
        fps = self._about["fps"]
        features = {
            key: {**each, "info": described(each["shape"], fps=fps)} if _is_video(each) else each
            for key, each in self._about["features"].items()
        }
        info = layout.info(
            fps=fps,
            features=features,
            episodes=self._episode_count,
            frames=self._frames,
            tasks=len(self._tasks),
            has_videos=bool(self._videos),
        )
        _write_json(info, self._folder / layout.INFO)

    def facts(self) -> dict[str, Any]:
        """Return the facts of join_episodes."""
        return {
            "total_episodes": self._episode_count,
            "total_frames": self._frames,
            "total_tasks": len(self._tasks),
            **self._sums,
            "problems": self._problems,
        }

    def _tables(self, pattern: str, kind: str) -> RollingFiles[pq.ParquetWriter, pa.Table]:
        def open_table(path: Path, table: pa.Table) -> pq.ParquetWriter:
            return pq.ParquetWriter(path, table.schema, compression="snappy")

        return RollingFiles(self._folder, pattern, layout.MOST_MB[kind], self._opened, open_table)

    def _video_files(self, key: str) -> RollingFiles[JoinedVideo, Path]:
        fps = self._about["fps"]
        pattern = layout.VIDEO.replace("{video_key}", key)
        most_mb = layout.MOST_MB["video"]
        return RollingFiles(self._folder, pattern, most_mb, self._opened, lambda path, _: JoinedVideo(path, fps=fps))

    def _appended_video(self, key: str, path: Path, frames: int) -> dict[str, Any]:
        """Append an episode's video; return where it is now."""
        size = path.stat().st_size
        place = self._videos[key].place_for(size)
        video = self._videos[key].file_for(path, size)
        before, fps = video.frames, self._about["fps"]
        video.append(path, frames)
        return {**place, "from_timestamp": before / fps, "to_timestamp": video.frames / fps}

    def _numbered(self, table: pa.Table) -> tuple[pa.Table, list[str]]:
        """Return an episode's table with counters in place of its tasks' texts, and the tasks."""
        texts = table[TASK].combine_chunks().dictionary_decode()
        tasks: list[str] = pc.unique(texts).to_pylist()
        for task in tasks:
            self._tasks.setdefault(task, len(self._tasks))
        frames = np.arange(len(table))
        counters = {
            "timestamp": (frames / self._about["fps"]).astype(np.float32),
            "frame_index": frames,
            "episode_index": np.full(len(table), self._episode_count),
            "index": frames + self._frames,
            "task_index": np.array([self._tasks[task] for task in texts.to_pylist()]),
        }
        table = table.drop_columns([TASK])
        for name, values in counters.items():
            table = table.append_column(name, pa.array(values))
        return table, tasks


def _is_video(feature: Mapping[str, Any]) -> bool:
    return bool(feature["dtype"] == "video")


def _difference(features: Mapping[str, Any], expected: Mapping[str, Any]) -> str:
    """Say how an episode's features differ from the first's; return nothing where they are the same."""
    for key, each in expected.items():
        found = features[key]
        if found["shape"] != each["shape"]:
            return f"{key} has the shape {found['shape']}, expected {each['shape']}"
        if found["names"] != each["names"]:
            return f"{key} has {', '.join(found['names'])}, expected {', '.join(each['names'])}"
    return ""


def _write_json(value: object, path: Path) -> None:
    path.write_text(json.dumps(value, indent=4, ensure_ascii=False), encoding="utf-8")
