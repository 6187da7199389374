"""A slow and obvious decoder of CDR, that the columns are compared with: one message at a time, value after value."""

import struct
from typing import Any

from rosbags.interfaces import Nodetype

CODES = {
    "bool": "?",
    "byte": "B",
    "octet": "B",
    "char": "B",
    "uint8": "B",
    "int8": "b",
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "int64": "q",
    "float32": "f",
    "float64": "d",
}
"""What `struct` calls the numbers of definitions."""

_BYTES = ("byte", "octet", "char", "uint8")


class _NoMessageError(Exception):
    """The payload is no message of this type."""


def decode(store: Any, name: str, payload: bytes) -> Any:
    """Return a message as Arrow's `to_pylist` gives it; None for bytes that are no such message."""
    if len(payload) < 4 or payload[0] or payload[1] > 1:
        return None
    reader = _Reader(store, payload[4:], "<" if payload[1] else ">")
    try:
        message = reader.message(name)
    except (_NoMessageError, struct.error, UnicodeDecodeError):
        return None
    return message if reader.at <= len(reader.body) <= reader.at + 3 else None


class _Reader:
    def __init__(self, store: Any, body: bytes, order: str) -> None:
        self.store, self.body, self.order = store, body, order
        self.at = 0

    def message(self, name: str) -> dict[str, Any]:
        return {field: self.value(kind) for field, kind in self.store.fielddefs[name][1]}

    def value(self, kind: Any) -> Any:
        what, of = kind
        if what == Nodetype.NAME:
            return self.message(of)
        if what == Nodetype.BASE:
            return self.text() if of[0] == "string" else self.number(CODES[of[0]])
        element, count = of
        if what == Nodetype.SEQUENCE:
            count = self.length()
        values = [self.value(element) for _ in range(count)]
        is_bytes = what == Nodetype.SEQUENCE and element[0] == Nodetype.BASE and element[1][0] in _BYTES
        return bytes(values) if is_bytes else values

    def number(self, code: str) -> Any:
        size = struct.calcsize(code)
        self.at += -self.at % size
        self.at += size
        return struct.unpack(self.order + code, self.body[self.at - size : self.at])[0]

    def length(self) -> int:
        found = int(self.number("I"))
        if found > len(self.body) - self.at:
            raise _NoMessageError
        return found

    def text(self) -> str:
        length = self.length()
        self.at += length
        return self.body[self.at - length : self.at].removesuffix(b"\0").decode()
