"""Walks over the values of serialized messages: over fields that are not wanted, or to copy them to another place.

The layout is that of the OMG's CDR (DDS-XTypes 1.3, 7.4.1 and 7.4.3.5). A primitive is aligned to its size, but to at
most 8 bytes in plain CDR and 4 in plain XCDR2, counted from the end of the encapsulation header. Strings and sequences
begin with a uint32 length; that of a string counts its final zero.
"""

import re
from collections.abc import Callable, Mapping
from struct import Struct
from typing import Final, Self, TypeAlias

from syncrelay.cdr import Payload

FieldsOf: TypeAlias = Callable[[str], Mapping[str, str]]
"""From a type's name to the names and types of its fields, in order, with rosidl's names of types."""

MOST_VALUES: Final = 20_000
"""At most this many values of a message are walked one by one. That takes 10 to 40 ms, while all groups wait."""

PRIMITIVES: Final = {
    "boolean": "?",
    "octet": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float": "f",
    "double": "d",
}
"""The codes of `struct`, by rosidl's names."""

STRING: Final = re.compile(r"string(<\d+>)?")
_ARRAY = re.compile(r"(?P<type>.+)\[(?P<count>\d+)\]")
_SEQUENCE = re.compile(r"sequence<(?P<type>.+?)(, \d+)?>")
_LENGTHS = {order: Struct(f"{order}I") for order in "<>"}
# Byte orders and largest alignments, by the second byte of the encapsulation header.
_ENCAPSULATIONS: Final = {0x00: (">", 8), 0x01: ("<", 8), 0x06: (">", 4), 0x07: ("<", 4)}
_BODY_AT: Final = 4


class UnreadableFieldError(Exception):
    """A field that cannot be read in place: a path that is not there, or a type without a plain layout."""


class Lying(Exception):  # noqa: N818  a payload's fault, told by None
    """A length that the payload cannot hold, or that takes too long to walk."""


class Body:
    """A payload without its encapsulation header, its byte order as in `struct`, and the largest alignment."""

    __slots__ = ("alignment", "content", "order", "passed")

    def __init__(self, content: memoryview, order: str, alignment: int) -> None:
        self.content, self.order, self.alignment = content, order, alignment
        self.passed = 0
        """How many values were walked one by one."""

    @classmethod
    def of(cls, payload: Payload) -> Self | None:
        """Return the body of a payload; None for one that is neither plain CDR nor plain XCDR2."""
        encapsulation = _ENCAPSULATIONS.get(payload[1]) if len(payload) >= _BODY_AT and not payload[0] else None
        return cls(memoryview(payload)[_BODY_AT:], *encapsulation) if encapsulation else None

    def align(self, place: int, size: int) -> int:
        """Return where a primitive of this size begins that stands at `place` or behind."""
        return place + -place % min(size, self.alignment)

    def run(self, place: int, size: int, count: int) -> int:
        """Pass primitives of one size; return where they end."""
        return place + -place % min(size, self.alignment) + size * count

    def repeat(self, place: int, walk: "Walk", count: int, *, is_fixed: bool) -> int:
        """Pass elements; `is_fixed` says that their size does not depend on their values, but for what aligns them."""
        if not is_fixed or count <= _FIRST:
            return self._one_by_one(place, walk, count)
        # The first may begin anywhere. It ends where the next, and so all others, begin: they have one size.
        first = self._one_by_one(place, walk, 1)
        return first + (self._one_by_one(first, walk, 1) - first) * (count - 1)

    def _one_by_one(self, place: int, walk: "Walk", count: int) -> int:
        self.require_room(place, count)
        self.pass_values(count)
        for _ in range(count):
            place = walk(self, place)
            self.require_room(place, 0)
        return place

    def length(self, place: int) -> tuple[int, int]:
        """Return the length of a string or sequence, and where its content begins, or what aligns that."""
        place += -place % 4
        (count,) = _LENGTHS[self.order].unpack_from(self.content, place)
        self.require_room(place, count)
        return count, place + 4

    def pass_values(self, count: int) -> None:
        """Count values that are walked one by one."""
        self.passed += count
        if self.passed > MOST_VALUES:
            raise Lying

    def require_room(self, place: int, count: int) -> None:
        """Raise Lying for more elements than bytes are left, as no element is smaller than a byte."""
        if count > len(self.content) - place:
            raise Lying


Walk: TypeAlias = Callable[[Body, int], int]
"""From the place where a value or the padding before it begins to the end of the value."""

# With fewer elements there is nothing to gain.
_FIRST: Final = 2


def walk_of(fields_of: FieldsOf, type_name: str) -> Walk:
    """Return what walks over values of a type; raises UnreadableFieldError for one without a plain layout."""
    if type_name in PRIMITIVES:
        return _run(type_name, 1)
    if STRING.fullmatch(type_name):
        return _walk_string
    if array := _ARRAY.fullmatch(type_name):
        if array["type"] in PRIMITIVES:
            return _run(array["type"], int(array["count"]))
        return _array(fields_of, array["type"], int(array["count"]))
    if sequence := _SEQUENCE.fullmatch(type_name):
        return _sequence(fields_of, sequence["type"])
    if "/" in type_name:
        return _message(fields_of, type_name)
    raise UnreadableFieldError(f"{type_name} has no plain layout")


def alignment_of(fields_of: FieldsOf, type_name: str) -> int:
    """Return the largest size of the primitives of a type, the lengths of its strings and sequences among them."""
    if array := _ARRAY.fullmatch(type_name):
        return alignment_of(fields_of, array["type"])
    if sequence := _SEQUENCE.fullmatch(type_name):
        return max(4, alignment_of(fields_of, sequence["type"]))
    if type_name in PRIMITIVES:
        return _size_of(type_name)
    if "/" not in type_name:
        return 4
    return max((alignment_of(fields_of, each) for each in fields_of(type_name).values()), default=1)


def _is_fixed(fields_of: FieldsOf, type_name: str) -> bool:
    if array := _ARRAY.fullmatch(type_name):
        return _is_fixed(fields_of, array["type"])
    if type_name in PRIMITIVES:
        return True
    return (
        "/" in type_name
        and not _SEQUENCE.fullmatch(type_name)
        and all(_is_fixed(fields_of, each) for each in fields_of(type_name).values())
    )


def _size_of(primitive: str) -> int:
    return Struct(f"<{PRIMITIVES[primitive]}").size


def _run(primitive: str, count: int) -> Walk:
    size = _size_of(primitive)
    return lambda body, place: body.run(place, size, count)


def _array(fields_of: FieldsOf, element: str, count: int) -> Walk:
    walk, is_fixed = walk_of(fields_of, element), _is_fixed(fields_of, element)
    return lambda body, place: body.repeat(place, walk, count, is_fixed=is_fixed)


def _sequence(fields_of: FieldsOf, element: str) -> Walk:
    size = _size_of(element) if element in PRIMITIVES else 0
    walk_one, is_fixed = walk_of(fields_of, element), _is_fixed(fields_of, element)

    def walk(body: Body, place: int) -> int:
        count, place = body.length(place)
        if size:
            return body.run(place, size, count) if count else place
        return body.repeat(place, walk_one, count, is_fixed=is_fixed)

    return walk


def _message(fields_of: FieldsOf, type_name: str) -> Walk:
    # A message without fields is written as a uint8 (rosidl: structure_needs_at_least_one_member).
    walks = [walk_of(fields_of, each) for each in fields_of(type_name).values() or ("uint8",)]

    def walk(body: Body, place: int) -> int:
        body.pass_values(len(walks))
        for each in walks:
            place = each(body, place)
        return place

    return walk


def _walk_string(body: Body, place: int) -> int:
    count, place = body.length(place)
    return body.run(place, 1, count)
