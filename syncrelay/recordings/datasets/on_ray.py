"""Sets of many recordings as a dataset of Ray Data, which the cluster reads block by block while training runs."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from os import PathLike, fspath
from typing import Any

import pyarrow as pa
from ray.data import Dataset, read_datasource
from ray.data.block import BlockMetadata
from ray.data.datasource import Datasource, ReadTask

from syncrelay.config import Config, load
from syncrelay.recordings.datasets.images import ImageFormat
from syncrelay.recordings.datasets.reading import MOST_BYTES, read_sets
from syncrelay.recordings.datasets.tables import Fields


def ray_dataset(
    recordings: Sequence[str | PathLike[str]],
    config: str | PathLike[str] | Config,
    *,
    group: str | None = None,
    fields: Fields | None = None,
    images: ImageFormat | Mapping[str, ImageFormat] | None = None,
    raw: bool = False,
    most_bytes: int = MOST_BYTES,
    **options: Any,
) -> Dataset:
    """Return the sets of recordings as a dataset; a row is a set, with the columns of `read_sets`.

    Each recording is a read task, so paths must be the same on every node. `options` are those of
    `ray.data.read_datasource`, such as `ray_remote_args={"memory": 2e9}`. Other arguments are those of `read_sets`.
    A recording that cannot be read fails its task and the reading of the dataset.
    """
    loaded = config if isinstance(config, Config) else load(fspath(config))
    read = partial(read_sets, config=loaded, group=group, fields=fields, images=images, raw=raw, most_bytes=most_bytes)
    return read_datasource(SetsOfRecordings([fspath(each) for each in recordings], read), **options)


class SetsOfRecordings(Datasource):  # type: ignore[misc]  # Ray's counts as untyped
    """See `ray_dataset`."""

    def __init__(self, recordings: Sequence[str], read: Callable[[str], Iterator[pa.RecordBatch]]) -> None:
        """`read` yields the sets of a recording."""
        super().__init__()
        self._recordings = tuple(recordings)
        self._read = read

    def estimate_inmemory_data_size(self) -> int | None:
        """See Ray; unknown before the recordings are read."""
        return None

    def get_read_tasks(self, parallelism: int, *_: Any, **__: Any) -> list[ReadTask]:
        """See Ray: at most `parallelism` tasks, of whole recordings."""
        shares = [self._recordings[first::parallelism] for first in range(min(parallelism, len(self._recordings)))]
        unknown = BlockMetadata(num_rows=None, size_bytes=None, input_files=None, exec_stats=None)
        return [ReadTask(partial(_blocks, self._read, share), unknown) for share in shares]


def _blocks(read: Callable[[str], Iterator[pa.RecordBatch]], recordings: Sequence[str]) -> Iterator[pa.Table]:
    for recording in recordings:
        for batch in read(recording):
            yield pa.Table.from_batches([batch])
