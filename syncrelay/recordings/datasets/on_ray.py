"""Sets of many recordings as a dataset of Ray Data, which the cluster reads block by block while training runs."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from os import PathLike, fspath
from typing import Any

import pyarrow as pa
from ray.data import Dataset, from_items

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

    Each recording is a task, so paths must be the same on every node. `options` are those of Ray's `map_batches`, such
    as `memory=2e9`. Other arguments are those of `read_sets`. A recording that cannot be read fails its task and the
    reading of the dataset.
    """
    loaded = config if isinstance(config, Config) else load(fspath(config))
    read = partial(read_sets, config=loaded, group=group, fields=fields, images=images, raw=raw, most_bytes=most_bytes)

    def tables(words: pa.Table) -> Iterator[pa.Table]:
        for batch in read(words["item"].to_pylist()):
            yield pa.Table.from_batches([batch])

    words = [fspath(each) for each in recordings]
    named = from_items(words, override_num_blocks=max(1, len(words)))
    return named.map_batches(tables, batch_size=1, batch_format="pyarrow", **options)
