"""Rows of tables with their times as numbers: Python has no type for a timestamp of nanoseconds."""

from typing import Any

import pyarrow as pa

TIME = pa.timestamp("ns", tz="UTC")


def rows_of(table: pa.Table | pa.RecordBatch) -> list[dict[str, Any]]:
    """The rows of a table, with each timestamp as the nanoseconds since 1970."""
    fields = [field.with_type(_plain(field.type)) for field in table.schema]
    rows: list[dict[str, Any]] = table.cast(pa.schema(fields)).to_pylist()
    return rows


def _plain(kind: pa.DataType) -> pa.DataType:
    if kind == TIME:
        return pa.int64()
    if pa.types.is_struct(kind) and all(field.type == TIME for field in kind):
        return pa.struct([field.with_type(pa.int64()) for field in kind])
    return kind
