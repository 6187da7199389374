"""Message types as types of Arrow, and how many bytes their values take in CDR.

A message within a message is a struct, `T[n]` a fixed-size list and `T[]` a list in Arrow. `uint8[]` and `byte[]` are
binary, so that images, clouds and packets stay bytes.
"""

from collections.abc import Iterable
from functools import lru_cache
from typing import Any, Final, TypeAlias

import numpy as np
import pyarrow as pa
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from syncrelay.config.wording import did_you_mean
from syncrelay.errors import BagError
from syncrelay.recordings.datasets.units import unit_of

Sizes: TypeAlias = tuple[int, ...] | None
"""How many bytes a value takes with the padding before it: for a value that begins 0, 1, ... 7 bytes behind a multiple
of 8 bytes. None where the size depends on the message: of strings and sequences, and what they are in.
"""

LARGEST_ALIGNMENT: Final = 8

_SINGLE: Final = {
    "bool": pa.bool_(),
    "byte": pa.uint8(),
    "octet": pa.uint8(),
    "char": pa.uint8(),
    "int8": pa.int8(),
    "uint8": pa.uint8(),
    "int16": pa.int16(),
    "uint16": pa.uint16(),
    "int32": pa.int32(),
    "uint32": pa.uint32(),
    "int64": pa.int64(),
    "uint64": pa.uint64(),
    "float32": pa.float32(),
    "float64": pa.float64(),
    "string": pa.string(),
}


def arrow_type(
    store: Typestore, type_name: str, paths: Iterable[str] | None = None, *, topic: str = ""
) -> pa.StructType:
    """Return a message's type in Arrow: with all its fields, or with those that dotted paths name.

    The path of a field within the elements of an array does not name the array's elements. Fields of a known unit have
    it in their metadata (`unit`). Raises BagError, which names the topic, for a field that is not there, and for one
    that cannot be decoded.
    """
    fields = dict(store.fielddefs[type_name][1])
    asked: dict[str, list[str]] = {name: [""] for name in fields} if paths is None else {}
    for path in paths or ():
        name, _, rest = path.partition(".")
        asked.setdefault(name, []).append(rest)
    for name in asked:
        if name not in fields:
            raise BagError(
                f"{topic}: {type_name} has no field `{name}`{did_you_mean(name, fields)}; it has {', '.join(fields)}"
            )
    found = []
    for name, description in fields.items():
        if name in asked:
            below = None if "" in asked[name] else asked[name]
            unit = unit_of(type_name, name)
            kind = _field_type(store, description, below, field=name, topic=topic)
            found.append(pa.field(name, kind, metadata={"unit": unit} if unit else None))
    return pa.struct(found)


def _field_type(store: Typestore, description: Any, paths: list[str] | None, *, field: str, topic: str) -> pa.DataType:
    kind, what = description
    if kind == Nodetype.NAME:
        return arrow_type(store, what, paths, topic=topic)
    if kind == Nodetype.BASE:
        if paths is not None:
            raise BagError(f"{topic}: `{field}` is a value and has no field `{paths[0]}`")
        if what[0] not in _SINGLE:
            raise BagError(f"{topic}: `{field}` is of type {what[0]}, which cannot be decoded: use --raw")
        return _SINGLE[what[0]]
    element, count = what
    of = _field_type(store, element, paths, field=field, topic=topic)
    if kind == Nodetype.ARRAY:
        return pa.list_(of, count)
    return pa.binary() if of == pa.uint8() else pa.list_(of)


def is_number(kind: pa.DataType) -> bool:
    """Tell whether a type is that of a number or a bool."""
    return bool(pa.types.is_primitive(kind))


def size_of(kind: pa.DataType) -> int:
    """Return how many bytes a number or a bool has."""
    return int(np.dtype(kind.to_pandas_dtype()).itemsize)


@lru_cache(maxsize=1000)
def sizes_of(kind: pa.DataType) -> Sizes:
    """Return the sizes of a type's values, see Sizes."""
    places = range(LARGEST_ALIGNMENT)
    if pa.types.is_struct(kind):
        parts = [sizes_of(field.type) for field in kind]
        ends = [*places]
        for part in parts:
            if part is None:
                return None
            ends = [end + part[end % LARGEST_ALIGNMENT] for end in ends]
        return tuple(end - place for place, end in zip(places, ends, strict=True))
    if pa.types.is_fixed_size_list(kind):
        each = sizes_of(kind.value_type)
        if each is None or not kind.list_size:
            return None if each is None else (0,) * LARGEST_ALIGNMENT
        # From the second on all take the same: each begins as far from the last alignment as the one before ended.
        strides = [each[(place + each[place]) % LARGEST_ALIGNMENT] for place in places]
        return tuple(each[place] + (kind.list_size - 1) * strides[place] for place in places)
    if not is_number(kind):
        return None
    size = size_of(kind)
    return tuple(-place % size + size for place in places)


def has_uneven_elements(kind: pa.DataType) -> bool:
    """Tell whether a type has arrays whose elements differ in size within a message."""
    if pa.types.is_struct(kind):
        return any(has_uneven_elements(field.type) for field in kind)
    is_array = pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind)
    return is_array and sizes_of(kind.value_type) is None
