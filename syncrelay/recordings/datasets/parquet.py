"""Sets as Parquet files: one for each group of a recording, in row groups of bounded size."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from syncrelay.output_files import cannot_be_written
from syncrelay.recordings.bag.mcap_output import Compression
from syncrelay.recordings.datasets.reading import SetsOf
from syncrelay.recordings.datasets.tables import SetTable

# Higher levels take twice the time to save a tenth of the size.
_ZSTD_LEVEL: Final = 1


def write_parquet(sets: SetsOf, steps: Iterable[None], folder: Path, *, compression: Compression) -> None:
    """Write the sets of each group that leave in the steps of a replay, a row group at a time.

    Each group has a file in the folder. Raises OutputError where a file cannot be written.
    """
    with ExitStack() as opened:
        writers: dict[SetTable, pq.ParquetWriter] = {}

        def write(group: SetTable, table: pa.Table, **options: int) -> None:
            if group not in writers:
                path = folder / f"{group.binding.group.name}.parquet"
                writers[group] = opened.enter_context(_open(path, table.schema, compression))
            writers[group].write_table(table, **options)

        try:
            for group, table in sets.parts(steps):
                write(group, table, row_group_size=len(table))
            for group in sets.groups:
                # A group without sets has a file too, which shows the columns.
                if group not in writers:
                    write(group, group.table())
        except OSError as error:
            raise cannot_be_written(folder, error) from error


def _open(path: Path, schema: pa.Schema, compression: Compression) -> pq.ParquetWriter:
    leaves = [*_leaves("", schema)]
    texts = [name for name, kind in leaves if pa.types.is_string(kind)]
    # Statistics are of no use for pictures and for elements of lists.
    compared = [name for name, kind in leaves if not pa.types.is_binary(kind) and ".list." not in name]
    # Pictures are compressed already.
    pictures = [f"{field.name}.data" for field in schema if _is_picture(field.type)]
    return pq.ParquetWriter(
        path,
        schema,
        compression={name: "none" if name in pictures else compression for name, _ in leaves},
        compression_level={name: _ZSTD_LEVEL for name, _ in leaves if name not in pictures and compression == "zstd"},
        use_dictionary=texts or False,
        write_statistics=compared or False,
        write_page_index=True,
    )


def _is_picture(kind: pa.DataType) -> bool:
    """Tell whether a column holds pictures, of CompressedImage or encoded here: a format beside bytes."""
    if not pa.types.is_struct(kind):
        return False
    types = {field.name: field.type for field in kind}
    return bool(types.get("format") == pa.string() and types.get("data") == pa.binary())


def _leaves(prefix: str, fields: Sequence[pa.Field] | pa.Schema | Any) -> Iterator[tuple[str, pa.DataType]]:
    """Yield Parquet's name of each column, and its type."""
    for field in fields:
        kind, name = field.type, f"{prefix}{field.name}"
        while pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
            kind, name = kind.value_type, f"{name}.list.element"
        if pa.types.is_dictionary(kind):
            kind = kind.value_type
        if pa.types.is_struct(kind):
            yield from _leaves(f"{name}.", kind)
        else:
            yield name, kind
