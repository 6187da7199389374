"""FOLDER/facts.parquet: the facts of all recordings in a folder of results, as one table."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from types import NoneType
from typing import Annotated, Any, Final, get_args, get_origin

import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import BaseModel, ValidationError

from syncrelay.errors import SyncRelayError
from syncrelay.output_files import begins_with, written_whole
from syncrelay.printable import printable
from syncrelay.recordings.fleet.facts import FACTS, FleetRow
from syncrelay.recordings.fleet.ledger import Entry, State
from syncrelay.recordings.fleet.robots import RobotPattern, robots_of
from syncrelay.urls import redacted

TABLE: Final = "facts.parquet"
"""The file with the rows of all recordings in the folder of all results."""

_AT_ONCE: Final = 1000
_MOST_BYTES: Final = 1 << 30
_ARROW: Final[dict[object, pa.DataType]] = {
    str: pa.string(),
    int: pa.int64(),
    float: pa.float64(),
    bool: pa.bool_(),
}


def schema_of(model: type[BaseModel]) -> pa.Schema:
    """Return the columns of a table whose rows are instances of a model."""
    return pa.schema([(name, _arrow(field.annotation)) for name, field in model.model_fields.items()])


def _arrow(kind: Any) -> pa.DataType:
    if kind in _ARROW:
        return _ARROW[kind]
    arguments = get_args(kind)
    if get_origin(kind) is tuple:
        return pa.list_(_arrow(arguments[0]))
    if get_origin(kind) is Annotated:
        return _arrow(arguments[0])
    if arguments:
        return _arrow(next(each for each in arguments if each is not NoneType))
    return pa.struct(list(schema_of(kind)))


def write_table(place: str, rows: Iterable[FleetRow]) -> Iterator[FleetRow]:
    """Write rows to a file or URL, some at a time, and yield each. Raises OutputError if it cannot be written."""
    schema = schema_of(FleetRow)
    batch: list[dict[str, Any]] = []
    with written_whole(place) as scratch, pq.ParquetWriter(scratch, schema, compression="zstd") as writer:
        for row in rows:
            batch.append(row.model_dump())
            if len(batch) == _AT_ONCE:
                writer.write_table(pa.Table.from_pylist(batch, schema))
                batch = []
            yield row
        writer.write_table(pa.Table.from_pylist(batch, schema))


def fleet_rows(folder: str, entries: Sequence[Entry], pattern: RobotPattern | None) -> Iterator[FleetRow]:
    """Yield the rows of all recordings with an entry in the ledger of a folder or URL, failed ones too."""
    entries = [entry for entry in entries if entry.state is not State.REMOVED]
    robots = robots_of([entry.recording for entry in entries], pattern)
    for entry, robot in zip(entries, robots, strict=True):
        for row in _rows_of(f"{folder}/{entry.name}", entry):
            yield row.model_copy(update={"robot": robot and printable(robot), "size_bytes": entry.size or None})


def _rows_of(result: str, entry: Entry) -> list[FleetRow]:
    if entry.state is State.FAILED:
        return [FleetRow(recording=entry.recording, error=entry.error)]
    rows = []
    with suppress(ValidationError):
        rows = [
            FleetRow.model_validate_json(line) for line in begins_with(f"{result}/{FACTS}", _MOST_BYTES).splitlines()
        ]
    if not rows:
        raise SyncRelayError(
            f"{redacted(result)}/{FACTS}: cannot be read: remove this folder, and run the command again with"
            f" {entry.recording} among the recordings"
        )
    return rows
