"""Payloads side by side: the next field of all of them is read, or skipped, at once.

A payload is plain CDR (DDSI-RTPS 2.5, 10.2; XCDR version 1): after four bytes of encapsulation come the fields in the
order of the definition. A number stands at a multiple of its size, counted from behind the encapsulation. A string and
a sequence begin with a uint32 length; a string's length counts the zero that it ends with.
"""

from collections.abc import Collection, Sequence
from typing import Any, Final, Literal, TypeAlias

import numpy as np
import pyarrow as pa

from syncrelay.recordings.datasets.message_types import LARGEST_ALIGNMENT, size_of, sizes_of

ENCAPSULATION: Final = 4
"""How many bytes a payload has before the message."""

Order: TypeAlias = Literal[">", "<"]
ORDERS: Final[tuple[Order, ...]] = (">", "<")
"""numpy's names of the byte orders that the second byte of a plain CDR payload stands for."""

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

    def __init__(self, buffer: bytes, order: Order, at: Integers, end: Integers, message: Integers) -> None:
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

    def numbers(self, kind: pa.DataType, count: int = 1) -> pa.Array:
        """Return the next `count` numbers of each row, row by row."""
        size = size_of(kind)
        begin = _aligned(self.at, size)
        self._go_to(begin + size * count)
        # Whole numbers from behind the first encapsulation to the end.
        most = (len(self._buffer) - ENCAPSULATION) // size
        values = np.frombuffer(self._buffer, self._dtype(kind), most, offset=ENCAPSULATION)
        first = (begin - ENCAPSULATION) // size
        if len(self) == 1:
            return _arrow_numbers(kind, values[first[0] : first[0] + count])
        return _arrow_numbers(kind, values[(first[:, None] + np.arange(count)).reshape(-1)])

    def run_of_numbers(self, kind: pa.DataType) -> tuple[pa.Array, Integers]:
        """Return the numbers of a sequence of each row, row by row, and how many each row has."""
        content, counts = self._run(size_of(kind))
        return _arrow_numbers(kind, np.frombuffer(content, self._dtype(kind))), counts

    def run_of_bytes(self) -> pa.Array:
        """Return a sequence of bytes of each row."""
        return _binary(*self._run(1))

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

    def elements(self, element: pa.DataType, counts: Integers) -> "Rows":
        """Go past the elements of an array or a sequence, and return them as rows, row by row."""
        begin = self.at
        known = sizes_of(element)
        if known is None:
            starts = self._go_through(element, counts)
        else:
            sizes = np.array(known)
            first = sizes[_residue(begin)]
            # From the second on all are equally far apart: each ends at the same distance from its last alignment.
            stride = sizes[_residue(begin + first)]
            self._go_to(begin + np.where(counts > 0, first + (counts - 1) * stride, 0))
            number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
            begin, first, stride = (np.repeat(each, counts) for each in (begin, first, stride))
            starts = begin + np.where(number > 0, first + (number - 1) * stride, 0)
        return Rows(self._buffer, self._order, starts, np.repeat(self.end, counts), np.repeat(self._message, counts))

    def skip(self, kind: pa.DataType) -> None:
        """Go past what nobody asks for."""
        sizes = sizes_of(kind)
        if sizes is not None:
            self._go_to(self.at + np.array(sizes)[_residue(self.at)])
        elif pa.types.is_struct(kind):
            for field in kind:
                self.skip(field.type)
        elif pa.types.is_fixed_size_list(kind):
            self.elements(kind.value_type, np.full(len(self), kind.list_size))
        elif pa.types.is_list(kind):
            self.elements(kind.value_type, self.lengths())
        else:
            lengths = self.lengths()
            self._go_to(self.at + lengths)

    def _go_to(self, at: Integers) -> None:
        self.at = at
        self.require(at <= self.end)

    def _dtype(self, kind: pa.DataType) -> "np.dtype[Any]":
        # Any byte but 0 is true.
        plain: np.dtype[Any] = np.dtype("u1" if pa.types.is_boolean(kind) else kind.to_pandas_dtype())
        return plain.newbyteorder(self._order)

    def _run(self, size: int) -> tuple[Any, Integers]:
        counts = self.lengths()
        # An empty sequence ends with its length, whatever its numbers would be aligned to.
        begin = np.where(counts > 0, _aligned(self.at, size), self.at)
        self._go_to(begin + counts * size)
        return self._content(begin, self.at), counts

    def _content(self, begin: Integers, end: Integers) -> Any:
        """Return the bytes of all rows, from one place to another, without a copy if there is one row."""
        whole = memoryview(self._buffer)
        parts = [whole[first:last] for first, last in zip(begin.tolist(), end.tolist(), strict=True)]
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def _go_through(self, element: pa.DataType, counts: Integers) -> Integers:
        """Go past elements of differing sizes, the first of all rows, then the second; return where each begins."""
        starts: list[Integers] = [np.zeros(0, np.int64)]
        owners: list[Integers] = [np.zeros(0, np.int64)]
        at = self.at.copy()
        for number in range(counts.max(initial=0)):
            among = np.flatnonzero(counts > number)
            rows = Rows(self._buffer, self._order, at[among], self.end[among], self._message[among])
            starts.append(rows.at)
            owners.append(among)
            rows.skip(element)
            at[among] = rows.at
        self.at = at
        return np.concatenate(starts)[np.argsort(np.concatenate(owners), kind="stable")]


def joined(payloads: Sequence[bytes], order: Order) -> Rows:
    """Return payloads as rows, each begun behind its encapsulation."""
    sizes = np.array([len(each) for each in payloads], np.int64)
    paddings = -sizes % LARGEST_ALIGNMENT
    begin = np.cumsum(sizes + paddings) - sizes - paddings
    buffer = payloads[0]
    if len(payloads) > 1:
        pieces = zip(payloads, map(bytes, paddings.tolist()), strict=True)
        buffer = b"".join([each for pair in pieces for each in pair])
    return Rows(buffer, order, begin + ENCAPSULATION, begin + sizes, np.arange(len(payloads)))


def _residue(place: Any) -> Any:
    """Return by how much places are off the largest alignment."""
    return (place - ENCAPSULATION) % LARGEST_ALIGNMENT


def _aligned(at: Integers, size: int) -> Integers:
    return at + -(at - ENCAPSULATION) % size


def _arrow_numbers(kind: pa.DataType, values: "np.ndarray[Any, Any]") -> pa.Array:
    if pa.types.is_boolean(kind):
        return pa.array(values != 0)
    native = values.astype(values.dtype.newbyteorder("="), copy=False)
    # Within one large payload numbers may stand at any address.
    return pa.array(np.require(native, requirements=["C", "A"]), type=kind)


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
