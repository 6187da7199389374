"""Serialized messages put together as the fields of another message: nothing is deserialized.

CDR aligns each value by its place in the whole message. So a message can be a field of another as it is where the field
begins at a multiple of its largest alignment. Elsewhere its first values are copied one by one, each with the padding
that its new place needs. Once one of the largest alignment has been copied, the rest can be copied as it is.
"""

from array import array
from collections.abc import Collection, Mapping
from struct import Struct, error
from typing import Final, NamedTuple

from syncrelay.cdr import Payload
from syncrelay.cdr_walk import MOST_VALUES, Body, FieldsOf, Lying, Walk, alignment_of, walk_of

ENCAPSULATION: Final = b"\0\1\0\0"
"""Of little-endian plain CDR."""

_NS_PER_SECOND: Final = 1_000_000_000
_STAMP: Final = Struct("<iI")
_ORDER, _ALIGNMENT = "<", 8
_ARRAYS: Final = {2: "H", 4: "I", 8: "Q"}


class UnfitError(Exception):
    """A payload that is not a message of the type that its field has."""


class _Field(NamedTuple):
    """A field of the type: what walks over a value, its largest alignment, and the place of its default value."""

    walk: Walk
    alignment: int
    begin: int
    end: int


class Assembler:
    """Makes messages of one type from the payloads of their fields."""

    def __init__(self, fields_of: FieldsOf, type_name: str, default: Payload) -> None:
        """Take the type, named `pkg/Name`, and a message of it with the values of fields that are not given.

        Raises UnreadableFieldError for a type with a field that has no plain layout, and UnfitError for a default that
        is not of the type.
        """
        self._default = _body(default, type_name)
        self._fields: dict[str, _Field] = {}
        place = 0
        for name, each in fields_of(type_name).items():
            walk, begin = walk_of(fields_of, each), place
            place = _end(walk, self._default, begin, name)
            self._fields[name] = _Field(walk, alignment_of(fields_of, each), begin, place)

    def assemble(
        self, contents: Mapping[str, Payload], *, stamp: int | None = None, stamped: Collection[str] = ()
    ) -> bytes:
        """Return the message with the payloads of these fields, and the default value in all others.

        The fields `stamped`, which begin with a Header, get the stamp, in nanoseconds. What is behind a message in its
        payload is left out: Fast DDS pads payloads, and rmw_serialize leaves as many bytes as it estimated too many.
        Raises UnfitError for a payload that is no message of its field's type.
        """
        parts = _Parts()
        for name, field in self._fields.items():
            content = contents.get(name)
            if content is None:
                parts.append(name, field, self._default, field.begin, field.end)
                continue
            body = _body(content, name)
            end = _end(field.walk, body, 0, name)
            first = len(parts.content)
            parts.append(name, field, body, 0, end)
            if stamp is not None and name in stamped:
                parts.overwrite(first, _STAMP.pack(*divmod(stamp, _NS_PER_SECOND)))
        return b"".join([ENCAPSULATION, *parts.content])


def _body(content: Payload, name: str) -> Body:
    body = Body.of(content)
    if body is None:
        raise UnfitError(f"{name} is not plain CDR")
    return body


def _end(walk: Walk, body: Body, place: int, name: str) -> int:
    try:
        end = walk(body, place)
        body.require_room(end, 0)
    except (error, Lying):
        raise UnfitError(f"{name} is cut off, or of another type") from None
    return end


class _Parts:
    """The body of a message as far as it was made."""

    def __init__(self) -> None:
        self.content: list[bytes | memoryview] = []
        self.size = 0

    def append(self, name: str, field: _Field, body: Body, begin: int, end: int) -> None:
        """Add a value that takes these bytes of a body, with the padding before it."""
        may_keep = body.order == _ORDER and body.alignment == _ALIGNMENT
        if not may_keep or (begin - self.size) % field.alignment:
            copied = _Copied(body, self, field.alignment if may_keep else 0)
            try:
                begin = field.walk(copied, begin)
            except _InPlace as rest:
                begin = rest.begin
            except Lying:
                raise UnfitError(f"{name} has more than {MOST_VALUES} values to be put in other places") from None
        self.add(body.content[begin:end])

    def add(self, content: bytes | memoryview) -> None:
        """Add bytes."""
        if len(content):
            self.content.append(content)
            self.size += len(content)

    def overwrite(self, index: int, stamp: bytes) -> None:
        """Put a stamp in the place of the one that begins a value, whose first part has this index."""
        rest = self.content[index:]
        # What was before this value, to find what aligns it.
        gap = -(self.size - sum(map(len, rest))) % 4
        left, self.content[index:] = bytes(gap) + stamp, []
        for part in rest:
            self.content += (left[: len(part)], part[len(left) :])
            left = left[len(part) :]


class _InPlace(Exception):  # noqa: N818  no error
    """All that follows in a value has the alignment that it needs."""

    def __init__(self, begin: int) -> None:
        super().__init__()
        self.begin = begin


class _Copied(Body):
    """A body whose values are copied as they are walked over. Raises _InPlace once the rest can stay as it is."""

    __slots__ = ("_alignment", "_parts")

    def __init__(self, body: Body, parts: _Parts, alignment: int) -> None:
        """Take the largest alignment of the values, 0 where all have to be copied."""
        super().__init__(body.content, body.order, body.alignment)
        self._parts = parts
        self._alignment = alignment

    def run(self, place: int, size: int, count: int) -> int:
        end = super().run(place, size, count)
        self._copy(end, size, count)
        return end

    def length(self, place: int) -> tuple[int, int]:
        count, end = super().length(place)
        self._copy(end, 4, 1)
        return count, end

    def _copy(self, end: int, size: int, count: int) -> None:
        """Copy primitives of one size that end here."""
        self._parts.add(bytes(-self._parts.size % size))
        content = self.content[end - size * count : end]
        self._parts.add(content if self.order == _ORDER or size == 1 else _swapped(content, size))
        if self._alignment and not (end - self._parts.size) % self._alignment:
            raise _InPlace(end)

    def repeat(self, place: int, walk: Walk, count: int, *, is_fixed: bool) -> int:  # noqa: ARG002  all are copied
        for _ in range(count):
            self.pass_values(1)
            place = walk(self, place)
        return place


def _swapped(content: memoryview, size: int) -> bytes:
    numbers = array(_ARRAYS[size], bytes(content))
    numbers.byteswap()
    return numbers.tobytes()
