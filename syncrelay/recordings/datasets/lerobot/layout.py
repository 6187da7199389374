"""LeRobotDataset v3.0 on disk, as lerobot 0.6.1 has it (lerobot/datasets/utils.py, dataset_metadata.py)."""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Generic, TypeVar

import pyarrow as pa

Opened = TypeVar("Opened")
Content = TypeVar("Content")

INFO: Final = "meta/info.json"
STATS: Final = "meta/stats.json"
TASKS: Final = "meta/tasks.parquet"
_FILE: Final = "chunk-{chunk_index:03d}/file-{file_index:03d}"
DATA: Final = f"data/{_FILE}.parquet"
EPISODES: Final = f"meta/episodes/{_FILE}.parquet"
VIDEO: Final = f"videos/{{video_key}}/{_FILE}.mp4"

_FILES_OF_A_CHUNK: Final = 1000
MOST_MB: Final = {"data": 100, "episodes": 100, "video": 200}
"""How large a file of each kind may grow."""

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


class RollingFiles(Generic[Opened, Content]):
    """Files of one kind that are written one after another, each of bounded size."""

    def __init__(
        self,
        folder: Path,
        pattern: str,
        most_mb: float,
        opened: ExitStack,
        open_file: Callable[[Path, Content], AbstractContextManager[Opened]],
    ) -> None:
        """`open_file` takes a path and the content that is written first; `opened` closes the last file."""
        self._folder = folder
        self._pattern = pattern
        self._most = most_mb * _MB
        self._open_file = open_file
        self._current = opened.enter_context(ExitStack())
        self._file: Opened | None = None
        self._number = 0
        self._size = 0

    def place_for(self, size: int) -> dict[str, int]:
        """Return the indices of the file that takes so many bytes more. An empty file takes any number of bytes."""
        if self._size and self._size + size >= self._most:
            self._current.close()
            self._file = None
            self._number += 1
            self._size = 0
        chunk, file = divmod(self._number, _FILES_OF_A_CHUNK)
        return {"chunk_index": chunk, "file_index": file}

    def file_for(self, content: Content, size: int) -> Opened:
        """Return the open file that this content of so many bytes is to be written to."""
        place = self.place_for(size)
        if self._file is None:
            path = self._folder / self._pattern.format(**place)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._current.enter_context(self._open_file(path, content))
        self._size += size
        return self._file


def info(
    *, fps: int, features: Mapping[str, Any], episodes: int, frames: int, tasks: int, has_videos: bool
) -> dict[str, Any]:
    """Return the content of meta/info.json."""
    counters = {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in COUNTERS.items()}
    return {
        "codebase_version": "v3.0",
        "fps": fps,
        "features": {**features, **counters},
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": _FILES_OF_A_CHUNK,
        "data_files_size_in_mb": MOST_MB["data"],
        "video_files_size_in_mb": MOST_MB["video"],
        "data_path": DATA,
        "video_path": VIDEO if has_videos else None,
        "robot_type": None,
        "splits": {"train": f"0:{episodes}"},
    }


def tasks_table(tasks: Sequence[str]) -> pa.Table:
    """Return the table of tasks. Its metadata makes pandas use the tasks' texts as the index, as LeRobot expects."""
    columns = {"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks, pa.string())}
    kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
    metadata = {
        "index_columns": ["task"],
        "column_indexes": [{"name": None, "field_name": None, **_pandas_type("unicode", "object")}],
        "columns": [{"name": name, "field_name": name, **_pandas_type(*kind)} for name, kind in kinds.items()],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.2.0",
    }
    return pa.table(columns).replace_schema_metadata({"pandas": json.dumps(metadata)})


def _pandas_type(kind: str, numpy: str) -> dict[str, Any]:
    return {"pandas_type": kind, "numpy_type": numpy, "metadata": None}
