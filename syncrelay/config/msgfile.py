"""The fields of a .msg file (ROS 2 interface definition), as far as a stamp's path needs them."""

import re
from typing import Final, NamedTuple

HEADER: Final = "std_msgs/msg/Header"
TIME: Final = "builtin_interfaces/msg/Time"

_FIELD = re.compile(
    r"(?P<type>[A-Za-z][\w/]*)(?P<bound><=\d+)?(?P<array>\[[^\]]*\])?\s+(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)"
)
PRIMITIVES: Final = frozenset(
    [
        "bool",
        "byte",
        "char",
        "float32",
        "float64",
        "int8",
        "uint8",
        "int16",
        "uint16",
        "int32",
        "uint32",
        "int64",
        "uint64",
        "string",
        "wstring",
    ]
)


class Field(NamedTuple):
    """A field: its type in full, a primitive's by its own name; whether it is an array of that type."""

    name: str
    type: str
    is_array: bool


def parse_fields(text: str, *, package: str) -> tuple[Field, ...]:
    """Return the fields in order; constants are none."""
    fields = []
    for line in text.splitlines():
        found = _FIELD.match(line.partition("#")[0].strip())
        if found is not None and not found["rest"].startswith("="):
            fields.append(Field(found["name"], _full_name(found["type"], package), found["array"] is not None))
    return tuple(fields)


def _full_name(written: str, package: str) -> str:
    if written in PRIMITIVES:
        return written
    owner, slash, name = written.rpartition("/")
    return f"{owner.removesuffix('/msg')}/msg/{name}" if slash else f"{package}/msg/{name}"
