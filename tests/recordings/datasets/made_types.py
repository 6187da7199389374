"""Message types and messages of any shape, for properties: what Hypothesis draws, rosbags serializes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

_NUMBERS = {
    "bool": st.booleans(),
    "byte": st.integers(0, 255),
    "int8": st.integers(-128, 127),
    "uint8": st.integers(0, 255),
    "int16": st.integers(-(2**15), 2**15 - 1),
    "uint16": st.integers(0, 2**16 - 1),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "int64": st.integers(-(2**63), 2**63 - 1),
    "uint64": st.integers(0, 2**64 - 1),
    "float32": st.floats(width=32, allow_nan=False),
    "float64": st.floats(allow_nan=False),
}
_TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=6)
_COUNTED = st.integers(0, 3)
_LITTLE = st.sampled_from([True])
_CONSTANTS = st.sampled_from(["", "uint8 A=1\n", 'int32 B=-1\nstring C="text"\nfloat64 D=0.5\n'])


@dataclass
class Made:
    """A type, what knows it, and messages of it: plain values and payloads."""

    store: Any
    type_name: str
    values: list[dict[str, Any]]
    payloads: list[bytes]


@st.composite
def made(draw, *, most_messages: int = 12, little_endian=_LITTLE):
    """A type of up to three levels, and some messages of it."""
    definitions: dict[str, list[tuple[str, str, str]]] = {}
    name = _define(draw, definitions, 2)
    store = get_typestore(Stores.EMPTY)
    types: dict[str, Any] = {}
    for each, fields in definitions.items():
        text = draw(_CONSTANTS) + "".join(f"{kind}{shape} {field}\n" for kind, shape, field in fields)
        types |= get_types_from_msg(text, each)
    store.register(types)
    values = [_message(draw, definitions, name) for _ in range(draw(st.integers(1, 3)))]
    repeated = draw(st.lists(st.sampled_from(values), min_size=1, max_size=most_messages))
    payloads = [
        bytes(store.serialize_cdr(_object(store, definitions, name, value), name, little_endian=draw(little_endian)))
        for value in repeated
    ]
    return Made(store, name, repeated, payloads)


def _define(draw, definitions, levels):
    name = f"made_msgs/msg/T{len(definitions)}"
    definitions[name] = fields = []
    for index in range(draw(st.integers(1, 4))):
        kinds = [*_NUMBERS, "string"]
        if levels and draw(st.integers(0, 3)) == 0:
            kind = _define(draw, definitions, levels - 1).replace("/msg/", "/")
        else:
            kind = draw(st.sampled_from(kinds))
        shape = draw(st.sampled_from(["", "", "[]", "[2]", "[3]"]))
        fields.append((kind, shape, f"f{index}"))
    return name


def _message(draw, definitions, name):
    return {field: _value(draw, definitions, kind, shape) for kind, shape, field in definitions[name]}


def _value(draw, definitions, kind, shape):
    if not shape:
        return _single(draw, definitions, kind)
    count = draw(_COUNTED) if shape == "[]" else int(shape[1:-1])
    found = [_single(draw, definitions, kind) for _ in range(count)]
    return bytes(found) if shape == "[]" and kind in ("uint8", "byte") else found


def _single(draw, definitions, kind):
    if kind in _NUMBERS:
        return draw(_NUMBERS[kind])
    if kind == "string":
        return draw(_TEXT)
    return _message(draw, definitions, kind.replace("/", "/msg/"))


def _object(store, definitions, name, value):
    made = {}
    for kind, shape, field in definitions[name]:
        each = value[field]
        if kind in _NUMBERS:
            # To rosbags a `byte` is signed.
            if kind == "byte":
                each = np.array(list(each) if shape else [each], np.uint8).view(np.int8)
                each = each if shape else int(each[0])
            made[field] = np.array(list(each), dtype={"byte": "int8"}.get(kind, kind)) if shape else each
        elif kind == "string":
            made[field] = each
        else:
            inner = kind.replace("/", "/msg/")
            made[field] = (
                [_object(store, definitions, inner, one) for one in each]
                if shape
                else _object(store, definitions, inner, each)
            )
    return store.types[name](**made)
