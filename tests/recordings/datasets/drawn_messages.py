"""Message types and messages of any shape, drawn by chance. rosbags serializes what was drawn."""

import math
import random
import re
from typing import Any, NamedTuple

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

LARGE = 70_000
"""So many elements make a payload that is decoded by itself."""

_NUMBERS = [
    *("bool", "byte", "char", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"),
    *("float32", "float64"),
]
_SHAPES = ["", "", "", "[]", "[2]", "[3]", "[<=3]"]
_CONSTANTS = ["", "", "uint8 A=1\n", 'int32 B=-1\nstring C="text"\nfloat64 D=0.5\n']
_CHARACTERS = "aZ_/9 é€😀"


class Drawn(NamedTuple):
    """Messages of a type: as they should be read, and as they were serialized."""

    values: list[Any]
    payloads: list[bytes]


def drawn_type(chance: random.Random) -> tuple[Any, str]:
    """Return a typestore and a type in it, of up to three levels."""
    definitions: dict[str, str] = {}
    name = _define(chance, definitions, 2)
    return _store_of(definitions), name


def drawn_set(chance: random.Random) -> tuple[Any, str]:
    """Return a typestore and a type in it whose fields are messages and arrays of them, between others."""
    return _store_of(drawn_definitions(chance)), "made_msgs/msg/Set"


def drawn_definitions(chance: random.Random) -> dict[str, str]:
    """Draw the definition of such a type, and of those in it."""
    definitions: dict[str, str] = {}
    lines = []
    for number in range(chance.randint(2, 8)):
        if chance.random() < 0.9:
            kind = _define(chance, definitions, 2).replace("/msg/", "/")
            lines.append(f"{kind}{chance.choice(['', '', '', '', *_SHAPES])} f{number}\n")
        else:
            lines.append(f"{chance.choice([*_NUMBERS, 'string'])}{chance.choice(_SHAPES)} f{number}\n")
    definitions["made_msgs/msg/Set"] = "".join(lines)
    return definitions


def _store_of(definitions: dict[str, str]) -> Any:
    store = get_typestore(Stores.EMPTY)
    types: dict[str, Any] = {}
    for each, text in definitions.items():
        types |= get_types_from_msg(text, each)
    store.register(types)
    return store


def _define(chance: random.Random, definitions: dict[str, str], levels: int) -> str:
    name = f"made_msgs/msg/T{len(definitions)}"
    definitions[name] = ""
    lines = []
    for number in range(chance.randint(0, 4)):
        kind = chance.choice([*_NUMBERS, "string", "string<=4"])
        if levels and chance.random() < 0.3:
            kind = _define(chance, definitions, levels - 1).replace("/msg/", "/")
        lines.append(f"{kind}{chance.choice(_SHAPES)} f{number}\n")
    definitions[name] = chance.choice(_CONSTANTS) + "".join(lines)
    return name


def drawn_message(store: Any, name: str, chance: random.Random) -> Any:
    """Draw a message as rosbags serializes it."""
    longest = LARGE if chance.random() < 0.01 else 3
    return _message(store, name, chance, random.Random(chance.random()), longest)[1]


def drawn_messages(store: Any, name: str, chance: random.Random, *, count: int = 6) -> Drawn:
    """Draw messages in either byte order: some have the same lengths, one may be large."""
    values, payloads = [], []
    lengths = chance.random()
    for _ in range(count):
        lengths = chance.choice([lengths, chance.random()])
        longest = LARGE if chance.random() < 0.1 else 3
        plain, message = _message(store, name, chance, random.Random(lengths), longest)
        values.append(plain)
        payloads.append(bytes(store.serialize_cdr(message, name, little_endian=chance.random() < 0.7)))
    return Drawn(values, payloads)


def _message(store: Any, name: str, chance: random.Random, lengths: random.Random, longest: int) -> tuple[Any, Any]:
    """Return a message as Arrow should have it, and as rosbags serializes it."""
    plain, objects = {}, []
    for field, kind in store.fielddefs[name][1]:
        value, made = _value(store, kind, chance, lengths, longest)
        objects.append(made)
        plain[field] = value
    return plain, store.types[name](*objects)


def _value(store: Any, kind: Any, chance: random.Random, lengths: random.Random, longest: int) -> tuple[Any, Any]:
    what, of = kind
    if what == Nodetype.NAME:
        return _message(store, of, chance, lengths, longest)
    if what == Nodetype.BASE:
        return _single(of, chance, lengths)
    element, bound = of
    is_numbers = element[0] == Nodetype.BASE and element[1][0] != "string"
    most = longest if is_numbers and not bound else 3
    count = bound if what == Nodetype.ARRAY else lengths.randint(0 if most == 3 else most, min(bound or most, most))
    # Of a long run a few values, over and over: to draw each takes longer than all the rest.
    some = [_value(store, element, chance, lengths, 3) for _ in range(min(count, 50))]
    values, objects = ([each[side] for each in some] * (count // 50 + 1) for side in (0, 1))
    values, objects = values[:count], objects[:count]
    if not is_numbers:
        return values, objects
    type_name = element[1][0]
    is_bytes = what == Nodetype.SEQUENCE and type_name in ("byte", "octet", "char", "uint8")
    kinds = {"byte": "int8", "octet": "int8", "char": "uint8"}
    return bytes(values) if is_bytes else values, np.array(objects, dtype=kinds.get(type_name, type_name))


def _single(of: tuple[str, int], chance: random.Random, lengths: random.Random) -> tuple[Any, Any]:
    name, bound = of
    if name == "string":
        text = "".join(chance.choices(_CHARACTERS, k=lengths.randint(0, bound or 6)))
        return text, text
    if name in ("byte", "octet"):
        number = chance.choice((0, 127, 128, 255, chance.randrange(256)))
        # To rosbags it is signed.
        return number, number - 256 * (number > 127)
    value = _number(name, chance)
    return value, value


def _number(name: str, chance: random.Random) -> float:
    if name == "bool":
        return chance.random() < 0.5
    if name in ("float32", "float64"):
        found = chance.choice((0.0, -0.0, math.inf, -math.inf, math.nan, chance.gauss(0, 1e6)))
        return float(np.float32(found)) if name == "float32" else found
    bits = 8 if name == "char" else int(re.sub(r"\D", "", name))
    low = -(2 ** (bits - 1)) if name.startswith("int") else 0
    return chance.choice((low, low + 2**bits - 1, 0, chance.randrange(low, low + 2**bits)))
