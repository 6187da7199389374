"""Payloads to columns of Arrow: alike ones all at once, others one by one with rosbags."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import fields
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow as pa
from rosbags.serde import SerdeError
from rosbags.typesys.store import Typestore

from syncrelay.recordings.datasets.layouts import (
    Characters,
    Layout,
    Listed,
    Numbers,
    Parts,
    Place,
    Repeated,
    UnfitError,
    layout_of,
)
from syncrelay.recordings.datasets.message_types import Array, Node, Number, Run, Struct, Text, arrow_type, is_empty

# From here on a copy costs more than what is done for each message.
_LARGE: Final = 65_536
# Fewer than these are not worth a layout of their own.
_FEW: Final = 4
_MOST_LAYOUTS: Final = 16
_OF_BYTES: Final = "u1"
# What rosbags raises for bytes that are no such message.
_NOT_ONE: Final = (SerdeError, ValueError, IndexError, AssertionError, OverflowError, TypeError, MemoryError)


class _View(NamedTuple):
    """Messages side by side in a buffer: as numpy has shapes and strides, `base` bytes in."""

    buffer: Any
    order: str
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    base: int

    def numbers(self, code: str, size: int, offset: int, count: int | None) -> np.ndarray[Any, Any]:
        """Return the values of a field of all messages, one behind another, in this machine's byte order."""
        more = () if count is None else (count,)
        kind = np.dtype(self.order + code) if size > 1 else np.dtype("u1" if code == "?1" else code)
        shape, strides = self.shape + more, self.strides + (size,) * len(more)
        whole: np.ndarray[Any, Any] = np.ndarray(shape, kind, self.buffer, self.base + offset, strides)
        # Of one element each, numpy's reshape leaves the distances between them.
        found = np.ascontiguousarray(whole.reshape(-1))
        return found if found.dtype.isnative else found.astype(found.dtype.newbyteorder("="))

    @property
    def messages(self) -> int:
        """How many there are."""
        return int(np.prod(self.shape, dtype=np.int64))


class Decoder:
    """Decodes the messages of one type."""

    def __init__(self, store: Typestore, tree: Struct) -> None:
        """Take what knows the type, and the tree with the fields that are asked for."""
        self.arrow: Final = arrow_type(tree)
        """The type of the column."""
        self.undecodable = 0
        """How many payloads were no such message: they are null."""
        self._store = store
        self._tree = tree
        self._layouts: dict[tuple[int, bytes], list[Layout]] = {}

    def decode(self, payloads: Sequence[bytes | None]) -> pa.ChunkedArray:
        """Return a column with a row a payload, null for None and for what cannot be decoded."""
        large = [None if payload is None or len(payload) < _LARGE else self._one(payload) for payload in payloads]
        if all(each is not None for each in large):
            return pa.chunked_array(large, type=self.arrow)
        alike: dict[tuple[int, bytes], list[int]] = defaultdict(list)
        parts: list[pa.Array] = []
        places: list[int] = []
        for place, payload in enumerate(payloads):
            array = large[place]
            if array is not None:
                parts.append(array)
                places.append(place)
            elif payload is not None and len(payload) < _LARGE:
                alike[len(payload), payload[:2]].append(place)
        for key, among in alike.items():
            for array, found in self._decoded(key, among, payloads):
                parts.append(array)
                places += found
        return pa.chunked_array([self._ordered(parts, places, len(payloads))], type=self.arrow)

    def _ordered(self, parts: Sequence[pa.Array], places: Sequence[int], count: int) -> pa.Array:
        """Return the rows of all parts, each at its place; where there is none, null."""
        if not parts:
            return pa.nulls(count, self.arrow)
        whole = parts[0] if len(parts) == 1 else pa.concat_arrays(parts)
        if places == list(range(count)):
            return whole
        index = np.full(count, -1, np.int64)
        index[places] = np.arange(len(places))
        return whole.take(pa.array(index, mask=index < 0))

    def _one(self, payload: bytes) -> pa.Array:
        """Decode a large payload, of which nothing is copied."""
        for layout in self._known(len(payload), payload[:2]):
            if _is_laid_out(payload, layout):
                return self._columns(layout, payload, 1, len(payload))
        try:
            layout = self._learned(payload)
        except UnfitError:
            return self._singly([payload])
        return self._columns(layout, payload, 1, len(payload))

    def _decoded(
        self, key: tuple[int, bytes], among: list[int], payloads: Sequence[Any]
    ) -> list[tuple[pa.Array, list[int]]]:
        """Decode payloads of one size: rows, and where they belong."""
        done: list[tuple[pa.Array, list[int]]] = []
        size, _ = key
        tried = 0
        while len(among) >= _FEW and tried < _MOST_LAYOUTS:
            known = self._known(*key)
            try:
                layout = known[tried] if tried < len(known) else self._learned(payloads[among[0]])
            except UnfitError:
                break
            tried += 1
            joined = b"".join([payloads[place] for place in among])
            fits = _laid_out(joined, len(among), size, layout)
            if fits.all():
                done.append((self._columns(layout, joined, len(among), size), among))
                return done
            if fits.any():
                chosen = [place for place, fit in zip(among, fits, strict=True) if fit]
                among = [place for place, fit in zip(among, fits, strict=True) if not fit]
                some = b"".join([payloads[place] for place in chosen])
                done.append((self._columns(layout, some, len(chosen), size), chosen))
        if among:
            done.append((self._singly([payloads[place] for place in among]), among))
        return done

    def _known(self, size: int, head: bytes) -> list[Layout]:
        return self._layouts.get((size, head), [])

    def _learned(self, payload: bytes) -> Layout:
        layout = layout_of(self._tree, payload)
        among = self._layouts.setdefault((len(payload), payload[:2]), [])
        # What varies so much is the same again by chance only.
        if len(among) >= _MOST_LAYOUTS:
            del among[0]
        if len(self._layouts) > _MOST_LAYOUTS * _MOST_LAYOUTS:
            self._layouts.clear()
        among.append(layout)
        return layout

    def _columns(self, layout: Layout, buffer: bytes, count: int, size: int) -> pa.Array:
        """Decode payloads that stand side by side, one by one if there is one among them that cannot be."""
        try:
            return _column(self._tree, layout.root, _View(buffer, layout.order, (count,), (size,), 0))
        except UnfitError:
            return self._singly([buffer[begin : begin + size] for begin in range(0, count * size, size)])

    def _singly(self, payloads: Sequence[bytes]) -> pa.Array:
        """Decode one by one."""
        return pa.array([self._value(payload) for payload in payloads], type=self.arrow)

    def _value(self, payload: bytes) -> dict[str, Any] | None:
        # As in layouts: a count beyond the message's own bytes is a lie. Others use the store too.
        unlimited, self._store.max_sequence_length = self._store.max_sequence_length, max(1, len(payload))
        try:
            if payload[0] or payload[1] > 1:
                raise ValueError("it is not plain CDR")
            message = self._store.deserialize_cdr(payload, self._tree.type)
            value: dict[str, Any] = _plain(self._tree, message)
        except _NOT_ONE:
            self.undecodable += 1
            return None
        finally:
            self._store.max_sequence_length = unlimited
        return value


def _is_laid_out(payload: bytes, layout: Layout) -> bool:
    return bool(_laid_out(payload, 1, len(payload), layout).all())


def _laid_out(joined: bytes, count: int, size: int, layout: Layout) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Tell which of payloads that stand side by side are laid out so."""
    fits = np.ones(count, np.bool_)
    for offset, length in layout.lengths:
        fits &= np.ndarray((count,), layout.order + "u4", joined, offset, (size,)) == length
    for offset in layout.ends:
        fits &= np.ndarray((count,), _OF_BYTES, joined, offset, (size,)) == 0
    return fits


def _column(node: Node, place: Place, view: _View) -> pa.Array:
    """Return a field of all messages of a view."""
    match node, place:
        case Number(), Numbers():
            return _numbers(node, place.offset, None, view)
        case Text(), Characters():
            return _texts(place, view)
        case Struct(), Parts():
            arrays = [
                _column(field.node, part, view)
                for field, part in zip(node.fields, place.parts, strict=True)
                if field.is_asked and not is_empty(field.node)
            ]
            return pa.StructArray.from_arrays(arrays, fields=list(arrow_type(node)))
        case Run(is_bytes=True), Numbers(count=int(count)):
            return _binary(pa.binary(), view.numbers(_OF_BYTES, 1, place.offset, count), count, view.messages)
        case ((Array() | Run()), _):
            values, count = _elements(node.element, place, view)
            return _lists(node, values, count, view.messages)
    raise AssertionError(f"{node} is no {place}")


def _elements(element: Node, place: Place, view: _View) -> tuple[pa.Array, int]:
    """Return the elements of a field, message by message, and how many each message has."""
    match place:
        case Numbers(offset, int(count)) if isinstance(element, Number):
            return _numbers(element, offset, count, view), count
        case Repeated(first, count, stride):
            shape, strides = (*view.shape, count), (*view.strides, stride)
            return _column(element, first, view._replace(shape=shape, strides=strides)), count
        case Listed(()):
            return pa.array([], type=arrow_type(element)), 0
        case Listed(elements):
            arrays = [_column(element, each, view) for each in elements]
            # One behind another now; then message by message.
            order = np.arange(len(arrays) * view.messages).reshape(len(arrays), view.messages).T.reshape(-1)
            return pa.concat_arrays(arrays).take(pa.array(order)), len(arrays)
    raise AssertionError(f"{element} is not at {place}")


def _numbers(node: Number, offset: int, count: int | None, view: _View) -> pa.Array:
    values = view.numbers(node.code, node.size, offset, count)
    return pa.array(values != 0) if pa.types.is_boolean(node.arrow) else pa.array(values, type=node.arrow)


def _lists(node: Array | Run, values: pa.Array, count: int, messages: int) -> pa.Array:
    kind = arrow_type(node)
    if isinstance(node, Array):
        return pa.FixedSizeListArray.from_arrays(values, type=kind)
    offsets = pa.array(np.arange(messages + 1, dtype=np.int32) * count, type=pa.int32())
    return pa.ListArray.from_arrays(offsets, values, type=kind)


def _texts(place: Characters, view: _View) -> pa.Array:
    content = view.numbers(_OF_BYTES, 1, place.offset, place.length)
    found = _binary(pa.binary(), content, place.length, view.messages)
    try:
        return found.cast(pa.string())
    except pa.ArrowInvalid as error:
        raise UnfitError("a string in it is not UTF-8") from error


def _binary(kind: pa.DataType, content: np.ndarray[Any, Any], length: int, count: int) -> pa.Array:
    offsets = np.arange(count + 1, dtype=np.int32) * length
    return pa.Array.from_buffers(kind, count, [None, pa.py_buffer(offsets), pa.py_buffer(content)])


def _plain(node: Node, value: Any) -> Any:
    """Return what rosbags decoded as Arrow takes it."""
    match node:
        case Struct():
            # rosbags renames fields that are Python's words, and keeps the definition's order. Its annotations are
            # texts, so dataclasses takes constants and the type's name for fields, too.
            own = [each.name for each in fields(value) if not str(each.type).startswith("ClassVar")]
            return {
                field.name: _plain(field.node, getattr(value, name))
                for field, name in zip(node.fields, own, strict=True)
                if field.is_asked and not is_empty(field.node)
            }
        case Run(is_bytes=True):
            return bytes(value)
        case Array() | Run():
            if isinstance(node.element, Number):
                # To rosbags a `byte` is signed.
                return value.view(np.uint8) if node.element.code == _OF_BYTES else value
            return [_plain(node.element, each) for each in value]
        case Number(code="u1"):
            return value & 0xFF
        case _:
            return value
