"""Matched sets as datasets: tables of Arrow, Parquet files, LeRobot datasets. Needs the extra `datasets`.

`read_sets` is for programs: sets stream into training with no files between.
"""

from syncrelay.datasets.reading import read_sets

__all__ = ["read_sets"]
