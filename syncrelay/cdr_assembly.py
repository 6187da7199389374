"""Serialized messages put together as the fields of another message: nothing is deserialized.

CDR aligns each value by its place in the whole message. So a message can be a field of another as it is where the field
begins at a multiple of its largest alignment. Elsewhere its first values are copied one by one, each with the padding
that its new place needs. Once one of the largest alignment has been copied, the rest can be copied as it is.
"""

from array import array
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from struct import Struct, error
from typing import Final, NamedTuple

from syncrelay.cdr import Payload
from syncrelay.cdr_walk import MOST_VALUES, Body, FieldsOf, Lying, Walk, alignment_of, walk_of

ENCAPSULATION: Final = b"\0\1\0\0"
"""Of little-endian plain CDR."""

_BODY_AT: Final = len(ENCAPSULATION)
_NS_PER_SECOND: Final = 1_000_000_000
_STAMP: Final = Struct("<iI")
_ORDER, _ALIGNMENT = "<", 8
_ARRAYS: Final = {2: "H", 4: "I", 8: "Q"}
_ZEROS: Final = memoryview(bytes(_ALIGNMENT))
# What pieces are of: the body, zeros, or the stamp that takes the place of another.
_OWN, _PADDING, _GIVEN = range(3)


class UnfitError(Exception):
    """A payload that is not a message of the type that its field has."""


class Assembler:
    """Makes messages of one type from the payloads of their fields."""

    def __init__(self, fields_of: FieldsOf, type_name: str, default: Payload) -> None:
        """Take the type, named `pkg/Name`, and a message of it with the values of fields that are not given.

        Raises UnreadableFieldError for a type with a field that has no plain layout, and UnfitError for a default that
        is not of the type.
        """
        body, place = _body(default, type_name), 0
        self._fields: dict[str, _Field] = {}
        for name, each in fields_of(type_name).items():
            walk, begin = walk_of(fields_of, each), place
            place = _end(walk, body, begin, name)
            self._fields[name] = _Field(name, walk, alignment_of(fields_of, each), (body, begin, place))

    def assemble(
        self, contents: Mapping[str, Payload], *, stamp: int | None = None, stamped: Collection[str] = ()
    ) -> bytes:
        """Return the message with the payloads of these fields, and the default value in all others.

        The fields `stamped`, which begin with a Header, get the stamp, in nanoseconds. What is behind a message in its
        payload is left out: Fast DDS pads payloads, and rmw_serialize leaves as many bytes as it estimated too many.
        Raises UnfitError for a payload that is no message of its field's type.
        """
        parts: list[bytes | memoryview] = [ENCAPSULATION]
        given = None if stamp is None else memoryview(_STAMP.pack(*divmod(stamp, _NS_PER_SECOND)))
        size = 0
        for name, field in self._fields.items():
            payload = contents.get(name)
            if payload is None:
                value = field.default(size % _ALIGNMENT)
                parts.append(value)
                size += len(value)
            else:
                own = given if name in stamped else None
                layout = field.layout(payload, size % _ALIGNMENT, is_stamped=own is not None)
                parts += _cut(layout.pieces, memoryview(payload)[_BODY_AT:], own)
                size += layout.size
        return b"".join(parts)


class _Piece(NamedTuple):
    """Bytes of a value, from a place to another of what `source` names; numbers of so many bytes are `swapped`."""

    source: int
    begin: int
    end: int
    swapped: int = 0


def _cut(pieces: Iterable[_Piece], body: memoryview, stamp: memoryview | None) -> Iterator[bytes | memoryview]:
    sources = body, _ZEROS, stamp or _ZEROS
    for source, begin, end, swapped in pieces:
        content = sources[source][begin:end]
        yield _swapped(content, swapped) if swapped else content


class _Field:
    """A field of the type: how its value is cut out of payloads, and its value where none is given."""

    def __init__(self, name: str, walk: Walk, alignment: int, default: tuple[Body, int, int]) -> None:
        """Take the walk over a value, its largest alignment, and where a body has the default value."""
        self._name, self._walk, self._alignment, self._default = name, walk, alignment, default
        self._defaults: dict[int, bytes] = {}
        self._last: _Layout | None = None

    def default(self, phase: int) -> bytes:
        """Return the default value, as it is so many bytes behind a multiple of 8."""
        if phase not in self._defaults:
            body, begin, end = self._default
            self._defaults[phase] = b"".join(_cut(self._pieces(body, begin, end, phase), body.content, None))
        return self._defaults[phase]

    def layout(self, payload: Payload, phase: int, *, is_stamped: bool) -> "_Layout":
        """Return how to cut a payload, with its own stamp or another, for a place so many bytes behind a multiple of 8.

        Raises UnfitError.
        """
        key = len(payload), bytes(payload[:2]), phase, is_stamped
        last = self._last
        if last is None or not last.fits(key, payload):
            body = _body(payload, self._name)
            end = _end(self._walk, body, 0, self._name)
            pieces = self._pieces(body, 0, end, phase)
            last = _Layout(_with_stamp(pieces, phase) if is_stamped else pieces, key, body)
            self._last = last
        return last

    def _pieces(self, body: Body, begin: int, end: int, phase: int) -> Sequence[_Piece]:
        """Return what makes the value that takes these bytes of a body, with the padding before it."""
        pieces: list[_Piece] = []
        may_keep = body.order == _ORDER and body.alignment == _ALIGNMENT
        if not may_keep or (begin - phase) % self._alignment:
            copied = _Copied(body, pieces, phase, self._alignment if may_keep else 0)
            try:
                begin = self._walk(copied, begin)
            except _InPlace as rest:
                begin = rest.begin
            except Lying:
                raise UnfitError(f"{self._name} has more than {MOST_VALUES} values to be put in other places") from None
        return [*pieces, _Piece(_OWN, begin, end)] if begin < end else pieces


class _Layout:
    """How payloads are cut that are alike.

    In CDR all is where the lengths of the strings and sequences before it put it. So what was found of one message
    holds for each that has the same lengths in the same places.
    """

    __slots__ = ("_ends", "_key", "_order", "_read", "_values", "pieces", "size")

    def __init__(self, pieces: Sequence[_Piece], key: Hashable, body: "_Measured") -> None:
        """Take what the pieces depend on beside lengths, and a body that was walked over."""
        self.pieces: Final = pieces
        self.size: Final = sum(each.end - each.begin for each in pieces)
        self._key, self._order = key, body.order
        self._ends, self._values = tuple(body.lengths), tuple(body.lengths.values())
        self._read: Struct | None = None

    def fits(self, key: Hashable, payload: Payload) -> bool:
        """Whether a payload is alike."""
        if key != self._key:
            return False
        if self._read is None:
            # Not before: where sizes differ from message to message, it is never asked for.
            ends = pairwise((-_BODY_AT, *self._ends))
            self._read = Struct(self._order + "".join(f"{end - before - 4}xI" for before, end in ends))
        return self._read.unpack_from(payload) == self._values


class _Measured(Body):
    """A body that keeps the lengths which were read, by the places where they end."""

    __slots__ = ("lengths",)

    def __init__(self, content: memoryview, order: str, alignment: int) -> None:
        super().__init__(content, order, alignment)
        self.lengths: dict[int, int] = {}

    def length(self, place: int) -> tuple[int, int]:
        count, end = super().length(place)
        self.lengths[end] = count
        return count, end


def _body(content: Payload, name: str) -> _Measured:
    body = _Measured.of(content)
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


def _with_stamp(pieces: Sequence[_Piece], phase: int) -> Sequence[_Piece]:
    """Return a value's pieces with another stamp in the place of the one that begins it."""
    gap = -phase % 4
    before, left = gap + _STAMP.size, []
    for each in pieces:
        begin = min(each.end, each.begin + before)
        before -= begin - each.begin
        if begin < each.end:
            left.append(each._replace(begin=begin))
    return [_Piece(_PADDING, 0, gap), _Piece(_GIVEN, 0, _STAMP.size), *left]


class _InPlace(Exception):  # noqa: N818  no error
    """All that follows in a value has the alignment that it needs."""

    def __init__(self, begin: int) -> None:
        super().__init__()
        self.begin = begin


class _Copied(Body):
    """A body whose values are copied as they are walked over. Raises _InPlace once the rest can stay as it is."""

    __slots__ = ("_alignment", "_pieces", "_size")

    def __init__(self, body: Body, pieces: list[_Piece], size: int, alignment: int) -> None:
        """Take where pieces go, how many bytes lie before them, and the largest alignment; 0 where all are copied."""
        super().__init__(body.content, body.order, body.alignment)
        self._pieces, self._size, self._alignment = pieces, size, alignment

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
        self._add(_Piece(_PADDING, 0, -self._size % size))
        self._add(_Piece(_OWN, end - size * count, end, 0 if self.order == _ORDER or size == 1 else size))
        if self._alignment and not (end - self._size) % self._alignment:
            raise _InPlace(end)

    def _add(self, piece: _Piece) -> None:
        if piece.begin < piece.end:
            self._pieces.append(piece)
            self._size += piece.end - piece.begin

    def repeat(self, place: int, walk: Walk, count: int, *, is_fixed: bool) -> int:  # noqa: ARG002  all are copied
        for _ in range(count):
            self.pass_values(1)
            place = walk(self, place)
        return place


def _swapped(content: memoryview, size: int) -> bytes:
    numbers = array(_ARRAYS[size], bytes(content))
    numbers.byteswap()
    return numbers.tobytes()
