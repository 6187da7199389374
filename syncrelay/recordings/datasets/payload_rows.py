"""Payloads side by side: the next field of all of them is read, or skipped, at once.

A payload is plain CDR (DDSI-RTPS 2.5, 10.2; XCDR version 1): after four bytes of encapsulation come the fields in the
order of the definition. A number stands at a multiple of its size, counted from behind the encapsulation. A string and
a sequence begin with a uint32 length; a string's length counts the zero that it ends with.
"""

from collections.abc import Collection, Sequence
from struct import Struct as Packed
from struct import error
from typing import Any, Final, TypeAlias

import numpy as np
import pyarrow as pa

from syncrelay.recordings.datasets.message_types import Array, Node, Number, Run, Struct, Text, size_of_many

ENCAPSULATION: Final = 4
"""How many bytes a payload has before the message."""

ORDERS: Final = (">", "<")
"""numpy's names of the byte orders that the second byte of a plain CDR payload stands for."""

_COUNTS: Final = {order: Packed(f"{order}I") for order in ORDERS}
_LARGEST_ALIGNMENT: Final = 8

Integers: TypeAlias = "np.ndarray[Any, np.dtype[np.int64]]"


class UnfitError(Exception):
    """Some messages of a batch do not fit the type."""

    def __init__(self, messages: Collection[int]) -> None:
        super().__init__()
        self.messages = frozenset(messages)


class Rows:
    """Messages, or elements within messages, that are decoded together.

    `buffer` holds all of them, and in it what stands behind an encapsulation begins 4 bytes behind a multiple of 8.
    For each row, `at` is the place of what is decoded next, `end` the end of its message, and `message` the message's
    number.
    """

    def __init__(self, buffer: bytes, order: str, at: Integers, end: Integers, message: Integers) -> None:
        self.at = at
        self.end = end
        self._buffer = buffer
        self._order = order
        self._message = message

    def __len__(self) -> int:
        return len(self.at)

    def require(self, fits: "np.ndarray[Any, np.dtype[np.bool_]]") -> None:
        """Raise UnfitError for the messages of the rows that do not fit."""
        if not fits.all():
            raise UnfitError(self._message[~fits].tolist())

    def numbers(self, number: Number, count: int = 1) -> pa.Array:
        """Return the next `count` numbers of each row, row by row."""
        begin = _aligned(self.at, number.size)
        self._go_to(begin + number.size * count)
        dtype = np.dtype(self._order + number.code)
        size = number.size
        # Whole numbers from behind the first encapsulation to the end.
        values = np.frombuffer(self._buffer, dtype, (len(self._buffer) - ENCAPSULATION) // size, offset=ENCAPSULATION)
        first = (begin - ENCAPSULATION) // size
        if len(self) == 1:
            return _arrow_numbers(number, values[first[0] : first[0] + count])
        return _arrow_numbers(number, values[(first[:, None] + np.arange(count)).reshape(-1)])

    def run_of_numbers(self, number: Number) -> tuple[pa.Array, Integers]:
        """Return the numbers of a sequence of each row, row by row, and how many each row has."""
        content, counts = self._run(number)
        return _arrow_numbers(number, np.frombuffer(content, np.dtype(self._order + number.code))), counts

    def run_of_bytes(self, number: Number) -> pa.Array:
        """Return a sequence of bytes of each row."""
        content, counts = self._run(number)
        return _binary(content, counts)

    def texts(self) -> pa.Array:
        """Return the next string of each row."""
        lengths = self.lengths()
        begin = self.at
        self._go_to(begin + lengths)
        # As Fast CDR reads strings: one without a final zero has all its bytes.
        has_zero = (lengths > 0) & (np.frombuffer(self._buffer, np.uint8)[self.at - 1] == 0)
        found = _binary(self._content(begin, self.at - has_zero), lengths - has_zero)
        try:
            return found.cast(pa.string())
        except pa.ArrowInvalid:
            self.require(np.array([_is_utf_8(each) for each in found.to_pylist()]))
            raise

    def lengths(self) -> Integers:
        """Return the next length of each row. No element is smaller than a byte: one beyond the message is a lie."""
        begin = _aligned(self.at, 4)
        self._go_to(begin + 4)
        found = np.frombuffer(self._buffer, f"{self._order}u4", len(self._buffer) // 4)[begin // 4].astype(np.int64)
        self.require(found <= self.end - self.at)
        return found

    def elements(self, element: Node, counts: Integers) -> "Rows":
        """Go past the elements of an array or a sequence, and return them as rows, row by row."""
        begin = self.at
        if element.sizes is None:
            starts = self._go_through(element, counts)
        else:
            sizes = np.array(element.sizes)
            first = sizes[_residue(begin)]
            # From the second on all are equally far apart: each ends at the same distance from its last alignment.
            stride = sizes[_residue(begin + first)]
            self._go_to(begin + np.where(counts > 0, first + (counts - 1) * stride, 0))
            number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
            begin, first, stride = (np.repeat(each, counts) for each in (begin, first, stride))
            starts = begin + np.where(number > 0, first + (number - 1) * stride, 0)
        return Rows(self._buffer, self._order, starts, np.repeat(self.end, counts), np.repeat(self._message, counts))

    def skip(self, node: Node) -> None:
        """Go past what nobody asks for."""
        if node.sizes is not None:
            self._go_to(self.at + np.array(node.sizes)[_residue(self.at)])
            return
        match node:
            case Text():
                lengths = self.lengths()
                self._go_to(self.at + lengths)
            case Struct():
                for field in node.fields:
                    self.skip(field.node)
            case Array():
                self.elements(node.element, np.full(len(self), node.count))
            case Run():
                self.elements(node.element, self.lengths())

    def _go_to(self, at: Integers) -> None:
        self.at = at
        self.require(at <= self.end)

    def _run(self, number: Number) -> tuple[Any, Integers]:
        counts = self.lengths()
        # An empty sequence ends with its length, whatever its numbers would be aligned to.
        begin = np.where(counts > 0, _aligned(self.at, number.size), self.at)
        self._go_to(begin + counts * number.size)
        return self._content(begin, self.at), counts

    def _content(self, begin: Integers, end: Integers) -> Any:
        """Return the bytes of all rows, from one place to another, without a copy if there is one row."""
        whole = memoryview(self._buffer)
        parts = [whole[first:last] for first, last in zip(begin.tolist(), end.tolist(), strict=True)]
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def _go_through(self, element: Node, counts: Integers) -> Integers:
        """Go past elements of differing sizes one by one; return where each begins."""
        starts: list[int] = []
        unfit: list[int] = []
        behind: list[int] = []
        rows = zip(self.at.tolist(), self.end.tolist(), counts.tolist(), self._message.tolist(), strict=True)
        for at, end, count, message in rows:
            place = at
            try:
                for _ in range(count):
                    starts.append(place)
                    place = self._behind(element, place, end)
            except error:
                unfit.append(message)
            behind.append(place)
        if unfit:
            raise UnfitError(unfit)
        self.at = np.array(behind, np.int64)
        return np.array(starts, np.int64)

    def _behind(self, node: Node, place: int, end: int) -> int:
        """Return the place behind a field of one message; raises struct.error where that has ended before."""
        if node.sizes is not None:
            place += node.sizes[_residue(place)]
        elif isinstance(node, Struct):
            for field in node.fields:
                place = self._behind(field.node, place, end)
        elif isinstance(node, Array):
            for _ in range(node.count):
                place = self._behind(node.element, place, end)
        else:
            place += -place % 4
            (count,) = _COUNTS[self._order].unpack_from(self._buffer, place)
            place += 4
            if not isinstance(node, Run):
                place += count
            elif node.element.sizes is not None:
                place += size_of_many(node.element.sizes, count, _residue(place))
            else:
                for _ in range(count):
                    place = self._behind(node.element, place, end)
        if place > end:
            raise error
        return place


def joined(payloads: Sequence[bytes], order: str) -> Rows:
    """Return payloads as rows, each begun behind its encapsulation."""
    sizes = np.array([len(each) for each in payloads], np.int64)
    paddings = -sizes % _LARGEST_ALIGNMENT
    begin = np.cumsum(sizes + paddings) - sizes - paddings
    buffer = payloads[0]
    if len(payloads) > 1:
        pieces = zip(payloads, map(bytes, paddings.tolist()), strict=True)
        buffer = b"".join([each for pair in pieces for each in pair])
    return Rows(buffer, order, begin + ENCAPSULATION, begin + sizes, np.arange(len(payloads)))


def _residue(place: Any) -> Any:
    """Return by how much places are off the largest alignment."""
    return (place - ENCAPSULATION) % _LARGEST_ALIGNMENT


def _aligned(at: Integers, size: int) -> Integers:
    return at + -(at - ENCAPSULATION) % size


def _arrow_numbers(number: Number, values: "np.ndarray[Any, Any]") -> pa.Array:
    if pa.types.is_boolean(number.arrow):
        return pa.array(values != 0)
    native = values.astype(values.dtype.newbyteorder("="), copy=False)
    # Within one large payload numbers may stand at any address.
    return pa.array(np.require(native, requirements=["C", "A"]), type=number.arrow)


def _binary(content: Any, lengths: Integers) -> pa.Array:
    return pa.Array.from_buffers(
        pa.binary(), len(lengths), [None, offsets_of(lengths).buffers()[1], pa.py_buffer(content)]
    )


def offsets_of(lengths: Integers) -> pa.Array:
    return pa.array(np.concatenate(([0], np.cumsum(lengths))), pa.int32())


def _is_utf_8(text: bytes) -> bool:
    try:
        text.decode()
    except UnicodeDecodeError:
        return False
    return True
