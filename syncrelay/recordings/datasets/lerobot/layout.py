"""LeRobotDataset v3.0 on disk: names of its files, and those of its tables that readers take by more than columns.

As lerobot 0.6.1 writes and reads it (lerobot/datasets/utils.py, dataset_metadata.py).
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import pyarrow as pa

VERSION: Final = "v3.0"
INFO: Final = "meta/info.json"
STATS: Final = "meta/stats.json"
TASKS: Final = "meta/tasks.parquet"
_FILE: Final = "chunk-{chunk_index:03d}/file-{file_index:03d}"
DATA: Final = f"data/{_FILE}.parquet"
EPISODES: Final = f"meta/episodes/{_FILE}.parquet"
VIDEO: Final = f"videos/{{video_key}}/{_FILE}.mp4"

FILES_OF_A_CHUNK: Final = 1000
DATA_FILE_MB: Final = 100
VIDEO_FILE_MB: Final = 200
_MB: Final = 1024 * 1024

COUNTERS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "timestamp": "float32",
        "frame_index": "int64",
        "episode_index": "int64",
        "index": "int64",
        "task_index": "int64",
    }
)
"""Columns that every dataset has, with their types."""


@dataclass(slots=True)
class Rolling:
    """Which file of a kind is written: the next one where it would grow beyond a size."""

    most_mb: int
    chunk: int = 0
    file: int = 0
    size: int = 0

    def would_roll(self, size: int) -> bool:
        """Tell whether so many bytes more belong in the next file; an empty one takes any."""
        return bool(self.size) and self.size + size >= self.most_mb * _MB

    def roll(self) -> None:
        """Go on with the next file."""
        self.size = 0
        self.file += 1
        if self.file == FILES_OF_A_CHUNK:
            self.chunk, self.file = self.chunk + 1, 0

    def path(self, pattern: str, **names: str) -> str:
        """Return the name of the file."""
        return pattern.format(chunk_index=self.chunk, file_index=self.file, **names)


def info(
    *, fps: int, features: Mapping[str, Any], episodes: int, frames: int, tasks: int, has_videos: bool
) -> dict[str, Any]:
    """Return what meta/info.json says."""
    counters = {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in COUNTERS.items()}
    return {
        "codebase_version": VERSION,
        "fps": fps,
        "features": {**features, **counters},
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": FILES_OF_A_CHUNK,
        "data_files_size_in_mb": DATA_FILE_MB,
        "video_files_size_in_mb": VIDEO_FILE_MB,
        "data_path": DATA,
        "video_path": VIDEO if has_videos else None,
        "robot_type": None,
        "splits": {"train": f"0:{episodes}"},
    }


def tasks_table(tasks: Sequence[str]) -> pa.Table:
    """Return the table of tasks, whose index pandas reads from the words."""
    columns = {"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks, pa.string())}
    told = {
        "index_columns": ["task"],
        "column_indexes": [
            {"name": None, "field_name": None, "pandas_type": "unicode", "numpy_type": "object", "metadata": None}
        ],
        "columns": [_pandas("task_index", "int64", "int64"), _pandas("task", "unicode", "object")],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.2.0",
    }
    return pa.table(columns).replace_schema_metadata({"pandas": json.dumps(told)})


def _pandas(name: str, kind: str, numpy: str) -> dict[str, Any]:
    return {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
