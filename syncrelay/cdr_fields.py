"""One field of a serialized message, found by skipping the fields before it: nothing is deserialized.

The layout is that of the OMG's CDR (DDS-XTypes 1.3, 7.4.1 and 7.4.3.5). A primitive is aligned to its size, but to at
most 8 bytes in plain CDR and 4 in plain XCDR2, counted from the end of the encapsulation header. Strings and sequences
begin with a uint32 length; that of a string counts its final zero.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from struct import Struct, error
from typing import Any, Final, NamedTuple, TypeAlias

from syncrelay.cdr import Payload

FieldsOf: TypeAlias = Callable[[str], Mapping[str, str]]
"""From a type's name to the names and types of its fields, in order, with rosidl's names of types."""

TIME: Final = "builtin_interfaces/Time"

MOST_VALUES: Final = 20_000
"""At most this many values are skipped before a field. That takes 10 to 40 ms, while all groups wait."""

_NS_PER_SECOND: Final = 1_000_000_000
_PRIMITIVES: Final = {
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
_ARRAY = re.compile(r"(?P<type>.+)\[(?P<count>\d+)\]")
_SEQUENCE = re.compile(r"sequence<(?P<type>.+?)(, \d+)?>")
_STRING = re.compile(r"string(<\d+>)?")
# Byte orders and largest alignments, by the second byte of the encapsulation header.
_ENCAPSULATIONS: Final = {0x00: (">", 8), 0x01: ("<", 8), 0x06: (">", 4), 0x07: ("<", 4)}


_BODY_AT: Final = 4


class UnreadableFieldError(Exception):
    """A field that cannot be read in place: a path that is not there, or a type without a plain layout."""


class _Bytes(NamedTuple):
    """A payload without its encapsulation header, its byte order as in `struct`, and the largest alignment.

    The only item of `passed` counts the values that were skipped one by one.
    """

    body: memoryview
    order: str
    alignment: int
    passed: list[int]


_Skip: TypeAlias = Callable[[_Bytes, int], int]
"""From the place where a value or the padding before it begins to the end of the value."""
_Read: TypeAlias = Callable[[_Bytes, int], Any]


def field_reader(fields_of: FieldsOf, type_name: str, path: str) -> Callable[[Payload], Any]:
    """Return what reads the field at a dotted path: a number, a text, or a time in nanoseconds.

    The reader returns None for a payload that is malformed before the end of the field, or has more than MOST_VALUES
    values before it; consecutive numbers of an array count as one. Raises UnreadableFieldError if the type has no such
    field, or if the field is not one value.
    """
    skips, found = _route(fields_of, type_name, path.split("."))
    return _behind(skips, _reader(found, path))


def time_reader(fields_of: FieldsOf, type_name: str, path: str) -> Callable[[Payload], int | None]:
    """Return what reads the time at a dotted path; as field_reader, but raises its error for any other field, too."""
    skips, found = _route(fields_of, type_name, path.split("."))
    if found != TIME:
        raise UnreadableFieldError(f"{path} is {found}, expected {TIME}")
    return _behind(skips, _read_time)


def _behind(skips: Sequence[_Skip], read: _Read) -> Callable[[Payload], Any]:
    """Return what skips some values and then reads one."""

    def read_field(payload: Payload) -> Any:
        encapsulation = _ENCAPSULATIONS.get(payload[1]) if len(payload) >= _BODY_AT and not payload[0] else None
        if encapsulation is None:
            return None
        data = _Bytes(memoryview(payload)[_BODY_AT:], *encapsulation, [0])
        place = 0
        try:
            for skip in skips:
                place = skip(data, place)
            return read(data, place)
        except (error, UnicodeDecodeError, _Lying):
            return None

    return read_field


class _Lying(Exception):  # noqa: N818  a payload's fault, told by None
    """A length that the payload cannot hold, or that takes too long to skip."""


def _route(fields_of: FieldsOf, type_name: str, steps: Sequence[str]) -> tuple[list[_Skip], str]:
    """Return what skips the fields before a field, and the type of the field."""
    skips: list[_Skip] = []
    for step in steps:
        if "/" not in type_name or "<" in type_name or "[" in type_name:
            raise UnreadableFieldError(f"{type_name} has no field {step}")
        fields = fields_of(type_name)
        if step not in fields:
            raise UnreadableFieldError(f"{type_name} has no field {step}, it has {', '.join(fields)}")
        for name, each in fields.items():
            if name == step:
                type_name = each
                break
            skips.append(_skipper(fields_of, each))
    return skips, type_name


def _reader(type_name: str, path: str) -> _Read:
    if type_name == TIME:
        return _read_time
    if type_name in _PRIMITIVES:
        return _primitive_reader(_PRIMITIVES[type_name])
    if _STRING.fullmatch(type_name):
        return _read_string
    raise UnreadableFieldError(f"{path} is {type_name}, expected a number, a string or a time")


def _skipper(fields_of: FieldsOf, type_name: str) -> _Skip:
    if type_name in _PRIMITIVES:
        return _run_skipper(_size_of(type_name), 1)
    if _STRING.fullmatch(type_name):
        return _skip_string
    if array := _ARRAY.fullmatch(type_name):
        if array["type"] in _PRIMITIVES:
            return _run_skipper(_size_of(array["type"]), int(array["count"]))
        return _repeater(_skipper(fields_of, array["type"]), int(array["count"]))
    if sequence := _SEQUENCE.fullmatch(type_name):
        return _sequence_skipper(fields_of, sequence["type"])
    if "/" in type_name:
        return _message_skipper(fields_of, type_name)
    raise UnreadableFieldError(f"{type_name} has no plain layout")


def _size_of(primitive: str) -> int:
    return Struct(f"<{_PRIMITIVES[primitive]}").size


def _align(data: _Bytes, place: int, size: int) -> int:
    size = min(size, data.alignment)
    return (place + size - 1) // size * size


def _run_skipper(size: int, count: int) -> _Skip:
    return lambda data, place: _align(data, place, size) + size * count


def _repeater(skip: _Skip, count: int) -> _Skip:
    def repeat(data: _Bytes, place: int) -> int:
        _require_room(data, place, count)
        _pass(data, count)
        for _ in range(count):
            place = skip(data, place)
            _require_room(data, place, 0)
        return place

    return repeat


def _sequence_skipper(fields_of: FieldsOf, element: str) -> _Skip:
    size = _size_of(element) if element in _PRIMITIVES else 0
    skip_one = None if size else _skipper(fields_of, element)

    def skip(data: _Bytes, place: int) -> int:
        count, place = _read_length(data, place)
        if skip_one is None:
            return _align(data, place, size) + size * count if count else place
        return _repeater(skip_one, count)(data, place)

    return skip


def _message_skipper(fields_of: FieldsOf, type_name: str) -> _Skip:
    # A message without fields is written as a uint8 (rosidl: structure_needs_at_least_one_member).
    skips = [_skipper(fields_of, each) for each in fields_of(type_name).values() or ("uint8",)]

    def skip(data: _Bytes, place: int) -> int:
        _pass(data, len(skips))
        for each in skips:
            place = each(data, place)
        return place

    return skip


def _pass(data: _Bytes, count: int) -> None:
    """Count values that are skipped one by one."""
    data.passed[0] += count
    if data.passed[0] > MOST_VALUES:
        raise _Lying


def _read_length(data: _Bytes, place: int) -> tuple[int, int]:
    place = _align(data, place, 4)
    (count,) = Struct(f"{data.order}I").unpack_from(data.body, place)
    _require_room(data, place, count)
    return count, place + 4


def _require_room(data: _Bytes, place: int, count: int) -> None:
    """Raise _Lying for more elements than bytes are left, as no element is smaller than a byte."""
    if count > len(data.body) - place:
        raise _Lying


def _skip_string(data: _Bytes, place: int) -> int:
    count, place = _read_length(data, place)
    return place + count


def _read_string(data: _Bytes, place: int) -> str:
    count, place = _read_length(data, place)
    if len(data.body) < place + count:
        raise _Lying
    return bytes(data.body[place : place + count]).rstrip(b"\0").decode()


def _primitive_reader(code: str) -> _Read:
    structs = {order: Struct(order + code) for order in "<>"}

    def read(data: _Bytes, place: int) -> Any:
        struct = structs[data.order]
        return struct.unpack_from(data.body, _align(data, place, struct.size))[0]

    return read


def _read_time(data: _Bytes, place: int) -> int | None:
    seconds, nanoseconds = Struct(f"{data.order}iI").unpack_from(data.body, _align(data, place, 4))
    if nanoseconds >= _NS_PER_SECOND:
        return None
    return int(seconds * _NS_PER_SECOND + nanoseconds)
