"""One field of a serialized message, found by walking over the fields before it: nothing is deserialized."""

from collections.abc import Callable, Sequence
from struct import Struct, error
from typing import Any, Final, TypeAlias

from syncrelay.cdr import Payload
from syncrelay.cdr_walk import PRIMITIVES, STRING, Body, FieldsOf, Lying, UnreadableFieldError, Walk, walk_of

TIME: Final = "builtin_interfaces/Time"

_NS_PER_SECOND: Final = 1_000_000_000

_Read: TypeAlias = Callable[[Body, int], Any]


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


def _behind(skips: Sequence[Walk], read: _Read) -> Callable[[Payload], Any]:
    """Return what skips some values and then reads one."""

    def read_field(payload: Payload) -> Any:
        data = Body.of(payload)
        if data is None:
            return None
        place = 0
        try:
            for skip in skips:
                place = skip(data, place)
            return read(data, place)
        except (error, UnicodeDecodeError, Lying):
            return None

    return read_field


def _route(fields_of: FieldsOf, type_name: str, steps: Sequence[str]) -> tuple[list[Walk], str]:
    """Return what skips the fields before a field, and the type of the field."""
    skips: list[Walk] = []
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
            skips.append(walk_of(fields_of, each))
    return skips, type_name


def _reader(type_name: str, path: str) -> _Read:
    if type_name == TIME:
        return _read_time
    if type_name in PRIMITIVES:
        return _primitive_reader(PRIMITIVES[type_name])
    if STRING.fullmatch(type_name):
        return _read_string
    raise UnreadableFieldError(f"{path} is {type_name}, expected a number, a string or a time")


def _read_string(data: Body, place: int) -> str:
    count, place = data.length(place)
    if len(data.content) < place + count:
        raise Lying
    return bytes(data.content[place : place + count]).rstrip(b"\0").decode()


def _primitive_reader(code: str) -> _Read:
    structs = {order: Struct(order + code) for order in "<>"}

    def read(data: Body, place: int) -> Any:
        struct = structs[data.order]
        return struct.unpack_from(data.content, data.align(place, struct.size))[0]

    return read


def _read_time(data: Body, place: int) -> int | None:
    seconds, nanoseconds = Struct(f"{data.order}iI").unpack_from(data.content, data.align(place, 4))
    if nanoseconds >= _NS_PER_SECOND:
        return None
    return int(seconds * _NS_PER_SECOND + nanoseconds)
