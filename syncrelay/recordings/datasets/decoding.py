"""Payloads to columns of Arrow: a batch of messages is decoded field by field, each field of all messages at once."""

from collections import defaultdict
from collections.abc import Sequence
from typing import Final

import numpy as np
import pyarrow as pa

from syncrelay.recordings.datasets.message_types import Array, Node, Number, Run, Struct, Text, arrow_type, is_empty
from syncrelay.recordings.datasets.payload_rows import ENCAPSULATION, ORDERS, Rows, UnfitError, joined, offsets_of

# From here on copying a payload costs more than decoding it by itself.
_LARGE: Final = 65_536
# Some writers pad a payload to a multiple of four bytes.
_MOST_PADDING: Final = 3


class Decoder:
    """Decodes the messages of one type."""

    def __init__(self, tree: Struct) -> None:
        """Take the tree of the type, in which some fields may not be asked for."""
        self.arrow: Final = arrow_type(tree)
        """The type of the column."""
        self.undecodable = 0
        """How many payloads were not a message of this type. They are null."""
        self._tree = tree

    def decode(self, payloads: Sequence[bytes | None]) -> pa.ChunkedArray:
        """Return a column with a row for each payload: null for None and for what cannot be decoded."""
        together: dict[tuple[int, int], list[int]] = defaultdict(list)
        for place, payload in enumerate(payloads):
            if payload is None:
                continue
            if len(payload) < ENCAPSULATION or payload[0] or payload[1] >= len(ORDERS):
                self.undecodable += 1
            else:
                together[payload[1], place if len(payload) >= _LARGE else -1].append(place)
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

    def _decoded(self, payloads: Sequence[bytes | None], places: list[int], order: str) -> tuple[pa.Array, list[int]]:
        """Decode the payloads at these places; return the rows, and the places of those that could be decoded."""
        while places:
            rows = joined([payloads[place] or b"" for place in places], order)
            try:
                column = _column(self._tree, rows)
                rows.require((rows.at <= rows.end) & (rows.at + _MOST_PADDING >= rows.end))
            except UnfitError as unfit:
                self.undecodable += len(unfit.messages)
                places = [place for number, place in enumerate(places) if number not in unfit.messages]
            else:
                return column, places
        return pa.nulls(0, self.arrow), places


def _column(node: Node, rows: Rows) -> pa.Array:
    """Return a field of all rows."""
    match node:
        case Number():
            return rows.numbers(node)
        case Text():
            return rows.texts()
        case Struct():
            return _struct(node, rows)
        case Array():
            return pa.FixedSizeListArray.from_arrays(_elements(node, rows), type=arrow_type(node))
        case Run():
            return _run(node, rows)


def _struct(node: Struct, rows: Rows) -> pa.Array:
    columns = []
    for field in node.fields:
        if field.is_wanted and not is_empty(field.node):
            columns.append(_column(field.node, rows))
        else:
            rows.skip(field.node)
    return pa.Array.from_buffers(arrow_type(node), len(rows), [None], children=columns)


def _elements(node: Array, rows: Rows) -> pa.Array:
    if isinstance(node.element, Number):
        return rows.numbers(node.element, node.count)
    return _column(node.element, rows.elements(node.element, np.full(len(rows), node.count)))


def _run(node: Run, rows: Rows) -> pa.Array:
    if not isinstance(node.element, Number):
        counts = rows.lengths()
        values = _column(node.element, rows.elements(node.element, counts))
    elif node.is_bytes:
        return rows.run_of_bytes(node.element)
    else:
        values, counts = rows.run_of_numbers(node.element)
    return pa.ListArray.from_arrays(offsets_of(counts), values, type=arrow_type(node))
