"""Matched sets as datasets: tables of Arrow, Parquet files, LeRobot datasets. Needs the extra `datasets`.

Programs read sets with `read_sets`, or on a cluster with `ray_dataset` (extra `fleet`), without files in between.
"""

from typing import Any

from syncrelay.recordings.datasets.reading import read_sets

__all__ = ["ray_dataset", "read_sets"]


def __getattr__(name: str) -> Any:
    """Import Ray only when `ray_dataset` is used: it takes seconds."""
    if name == "ray_dataset":
        from syncrelay.recordings.datasets.on_ray import ray_dataset  # noqa: PLC0415

        return ray_dataset
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
