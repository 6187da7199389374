"""Matched sets as datasets: tables of Arrow, Parquet files, LeRobot datasets. Needs the extra `datasets`.

`read_sets` and `ray_dataset` (extra `fleet`) are for programs: sets stream into training with no files between.
"""

from typing import Any

from syncrelay.recordings.datasets.reading import read_sets

__all__ = ["ray_dataset", "read_sets"]


def __getattr__(name: str) -> Any:
    """Import Ray, which takes seconds, only for who asks for it."""
    if name == "ray_dataset":
        from syncrelay.recordings.datasets.on_ray import ray_dataset  # noqa: PLC0415

        return ray_dataset
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
