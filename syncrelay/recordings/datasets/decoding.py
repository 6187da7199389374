"""Payloads to columns of Arrow: a batch of messages is decoded field by field, each field of all messages at once."""

from collections import defaultdict
from collections.abc import Sequence
from typing import Final

import numpy as np
import pyarrow as pa

from syncrelay.recordings.datasets.message_types import has_uneven_elements, is_number
from syncrelay.recordings.datasets.payload_rows import (
    ENCAPSULATION,
    ORDERS,
    Order,
    Rows,
    UnfitError,
    joined,
    offsets_of,
)

# From here on copying a payload costs more than decoding it by itself, if its elements have known sizes.
_LARGE: Final = 65_536
# Some writers pad a payload to a multiple of four bytes.
_MOST_PADDING: Final = 3


class Decoder:
    """Decodes the messages of one type."""

    def __init__(self, whole: pa.StructType, wanted: pa.StructType) -> None:
        """Take the type of the messages with all fields, and with those that are wanted; see arrow_type."""
        self.arrow: Final = wanted
        """The type of the column."""
        self.undecodable = 0
        """How many payloads were not a message of this type. They are null."""
        self._whole = whole
        self._are_alone = not has_uneven_elements(whole)

    def decode(self, payloads: Sequence[bytes | None]) -> pa.ChunkedArray:
        """Return a column with a row for each payload: null for None and for what cannot be decoded."""
        together: dict[tuple[int, int], list[int]] = defaultdict(list)
        for place, payload in enumerate(payloads):
            if payload is None:
                continue
            if len(payload) < ENCAPSULATION or payload[0] or payload[1] >= len(ORDERS):
                self.undecodable += 1
            else:
                together[payload[1], place if self._are_alone and len(payload) >= _LARGE else -1].append(place)
        parts: list[pa.Array] = []
        places: list[int] = []
        for (order, _), among in together.items():
            array, decoded = self._decoded(payloads, among, ORDERS[order])
            parts.append(array)
            places += decoded
        if places == list(range(len(payloads))):
            return pa.chunked_array(parts, type=self.arrow)
        index = np.full(len(payloads), -1, np.int64)
        index[places] = np.arange(len(places))
        whole = pa.concat_arrays(parts) if parts else pa.nulls(0, self.arrow)
        return pa.chunked_array([whole.take(pa.array(index, mask=index < 0))], type=self.arrow)

    def _decoded(self, payloads: Sequence[bytes | None], places: list[int], order: Order) -> tuple[pa.Array, list[int]]:
        """Decode the payloads at these places; return the rows, and the places of those that could be decoded."""
        while places:
            rows = joined([payloads[place] or b"" for place in places], order)
            try:
                column = _column(self._whole, self.arrow, rows)
                rows.require((rows.at <= rows.end) & (rows.at + _MOST_PADDING >= rows.end))
            except UnfitError as unfit:
                self.undecodable += len(unfit.messages)
                places = [place for number, place in enumerate(places) if number not in unfit.messages]
            else:
                return column, places
        return pa.nulls(0, self.arrow), places


def _column(kind: pa.DataType, wanted: pa.DataType, rows: Rows) -> pa.Array:
    """Return a field of all rows, with those of its own fields that are wanted."""
    if pa.types.is_struct(kind):
        return _struct(kind, wanted, rows)
    if pa.types.is_fixed_size_list(kind):
        return pa.FixedSizeListArray.from_arrays(_elements(kind, wanted, rows), type=wanted)
    if pa.types.is_list(kind):
        return _run(kind, wanted, rows)
    if pa.types.is_binary(kind):
        return rows.run_of_bytes()
    return rows.texts() if pa.types.is_string(kind) else rows.numbers(kind)


def _struct(kind: pa.StructType, wanted: pa.StructType, rows: Rows) -> pa.Array:
    columns = []
    for field in kind:
        place = wanted.get_field_index(field.name)
        if place < 0:
            rows.skip(field.type)
        else:
            columns.append(_column(field.type, wanted.field(place).type, rows))
    return pa.Array.from_buffers(wanted, len(rows), [None], children=columns)


def _elements(kind: pa.FixedSizeListType, wanted: pa.FixedSizeListType, rows: Rows) -> pa.Array:
    element, count = kind.value_type, kind.list_size
    if is_number(element):
        return rows.numbers(element, count)
    return _column(element, wanted.value_type, rows.elements(element, np.full(len(rows), count)))


def _run(kind: pa.ListType, wanted: pa.ListType, rows: Rows) -> pa.Array:
    element = kind.value_type
    if is_number(element):
        values, counts = rows.run_of_numbers(element)
    else:
        counts = rows.lengths()
        values = _column(element, wanted.value_type, rows.elements(element, counts))
    return pa.ListArray.from_arrays(offsets_of(counts), values, type=wanted)
