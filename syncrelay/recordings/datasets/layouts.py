"""Where the fields of a message lie in its payload: found once, and used for all that have the same lengths in it.

A payload is plain CDR (DDSI-RTPS 2.5, 10.2; XCDR version 1): after four bytes of encapsulation every number stands at
a multiple of its size. What has strings and sequences of the same lengths is laid out alike: of a thousand Imu
messages with one frame_id, each field is a column at a fixed distance.
"""

from dataclasses import dataclass
from struct import Struct as Packed
from struct import error
from typing import Final, TypeAlias

from syncrelay.recordings.datasets.message_types import Array, Node, Number, Run, Struct, Text

ENCAPSULATION: Final = 4
# More elements of differing lengths than this are decoded one by one.
_MOST_ELEMENTS: Final = 64
# The payload's own length is a multiple of four where a writer pads it.
_MOST_PADDING: Final = 3
_COUNTS: Final = {"<": Packed("<I"), ">": Packed(">I")}


class UnfitError(Exception):
    """A payload that is no such message, or is laid out too irregularly to be gone through as columns."""


@dataclass(frozen=True, slots=True)
class Numbers:
    """One number, or `count` that stand side by side."""

    offset: int
    count: int | None


@dataclass(frozen=True, slots=True)
class Characters:
    """A string without its final zero."""

    offset: int
    length: int


@dataclass(frozen=True, slots=True)
class Parts:
    """The fields of a message, in their order."""

    parts: tuple["Place", ...]


@dataclass(frozen=True, slots=True)
class Repeated:
    """Elements that are all laid out as the first, `stride` bytes apart."""

    first: "Place"
    count: int
    stride: int


@dataclass(frozen=True, slots=True)
class Listed:
    """Elements that are laid out each in its own way."""

    elements: tuple["Place", ...]


Place: TypeAlias = Numbers | Characters | Parts | Repeated | Listed


@dataclass(frozen=True, slots=True)
class Layout:
    """Where all fields lie, and what a payload must hold to be laid out so.

    That is the lengths, as (offset, value), and at `ends` the zeros that strings end with.
    """

    order: str
    root: Parts
    lengths: tuple[tuple[int, int], ...]
    ends: tuple[int, ...]


def layout_of(tree: Struct, payload: bytes | memoryview) -> Layout:
    """Return where the fields of a payload lie; raises UnfitError where it ends too soon or is too irregular."""
    if len(payload) < ENCAPSULATION or payload[0] or payload[1] > 1:
        raise UnfitError("it is not plain CDR")
    walk = _Walk(payload, "<" if payload[1] else ">")
    root = walk.struct(tree)
    if walk.at > len(payload):
        raise UnfitError("it ends too soon")
    if walk.at + _MOST_PADDING < len(payload):
        raise UnfitError("it is longer than the message in it")
    if any(payload[end] for end in walk.ends):
        raise UnfitError("a string in it has no end")
    return Layout(walk.order, root, tuple(walk.lengths), tuple(walk.ends))


class _Walk:
    def __init__(self, payload: bytes | memoryview, order: str) -> None:
        self.order = order
        self.at = ENCAPSULATION
        self.lengths: list[tuple[int, int]] = []
        self.ends: list[int] = []
        self._payload = payload

    def struct(self, tree: Struct) -> Parts:
        # What no field tells, a byte stands for.
        if not tree.fields:
            self.at += 1
        return Parts(tuple([self._place(field.node) for field in tree.fields]))

    def _place(self, node: Node) -> Place:
        match node:
            case Number():
                return Numbers(self._skip(node, 1), None)
            case Text():
                length = self._length()
                self.at += length
                if length:
                    self.ends.append(self.at - 1)
                return Characters(self.at - length, max(0, length - 1))
            case Struct():
                return self.struct(node)
            case Array():
                return self._elements(node.element, node.count)
            case Run():
                return self._elements(node.element, self._length())

    def _skip(self, number: Number, count: int) -> int:
        """Go past numbers; return where the first one stands."""
        if count:
            self._align(number.size)
        begin = self.at
        self.at += number.size * count
        return begin

    def _align(self, size: int) -> None:
        self.at += -(self.at - ENCAPSULATION) % size

    def _length(self) -> int:
        self._align(4)
        try:
            (length,) = _COUNTS[self.order].unpack_from(self._payload, self.at)
        except error as fault:
            raise UnfitError("it ends too soon") from fault
        self.lengths.append((self.at, length))
        self.at += 4
        # No element is smaller than a byte: a larger length is a lie, and would be counted down for hours.
        if length > len(self._payload):
            raise UnfitError("a length in it is larger than itself")
        return int(length)

    def _elements(self, element: Node, count: int) -> Place:
        if isinstance(element, Number):
            return Numbers(self._skip(element, count), count)
        if not count:
            return Listed(())
        alignment = _alignment(element)
        if alignment is not None:
            self._align(_first_alignment(element))
            begin = self.at
            first = self._place(element)
            self._align(_first_alignment(element))
            stride = self.at - begin
            if count == 1 or not stride % alignment:
                # The last one has nothing behind it that aligns.
                self.at = begin + stride * (count - 1)
                self._place(element)
                return Repeated(first, count, stride)
            self.at = begin
        if count > _MOST_ELEMENTS:
            raise UnfitError("its elements are of differing lengths")
        return Listed(tuple([self._place(element) for _ in range(count)]))


def _alignment(node: Node) -> int | None:
    """Return what an element whose size is fixed is aligned to; None of one that holds strings or sequences."""
    match node:
        case Number():
            return node.size
        case Array():
            return _alignment(node.element)
        case Struct():
            known = [each for each in (_alignment(field.node) for field in node.fields) if each is not None]
            return max(known, default=1) if len(known) == len(node.fields) else None
        case _:
            return None


def _first_alignment(node: Node) -> int:
    match node:
        case Number():
            return node.size
        case Array():
            return _first_alignment(node.element)
        case Struct(fields=(first, *_)):
            return _first_alignment(first.node)
        case _:
            return 1
