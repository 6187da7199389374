"""The table of facts as its page shows it: the columns of each kind of row, from the models themselves."""

from collections.abc import Iterator
from types import NoneType
from typing import Any, NamedTuple, get_args, get_origin

from pydantic import BaseModel

from syncrelay.recordings.fleet.facts import FleetRow

_TYPES = {str: "text", int: "integer", float: "number", bool: "true or false"}


class _Column(NamedTuple):
    name: str
    kind: str
    meaning: str


class _Rows(NamedTuple):
    name: str
    meaning: str
    columns: list[_Column]


def facts(model: type[BaseModel] = FleetRow, name: str = "facts.parquet") -> Iterator[_Rows]:
    """Yield the columns of the table, then those of each list in it."""
    columns, lists = [], []
    for column, field in model.model_fields.items():
        kind, of = _kind(field.annotation)
        columns.append(_Column(column, kind, field.description or ""))
        if of is not None:
            lists.append((of, column))
    yield _Rows(name, model.__doc__ or "", columns)
    for of, column in lists:
        yield from facts(of, column)


def _kind(annotation: Any) -> tuple[str, type[BaseModel] | None]:
    """Return the word for a type, and the model that a list is of."""
    if annotation in _TYPES:
        return _TYPES[annotation], None
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "rows", annotation
    inner = next(each for each in get_args(annotation) if each is not NoneType)
    kind, of = _kind(inner)
    return (f"list of {kind}" if get_origin(annotation) is tuple else kind), of
