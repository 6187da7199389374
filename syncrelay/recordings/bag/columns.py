"""Stamps and keys of a batch of messages as columns: the stamps of leading headers are read all at once."""

from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import chain, repeat
from typing import Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from syncrelay.cdr import LATEST_STAMP, read_stamp
from syncrelay.clock import UNREADABLE, DeviceClock, host_times
from syncrelay.config import GroupConfig, StampSource
from syncrelay.explain.received import Places, by_place, joined
from syncrelay.recordings.bag.definitions import begins_with_header
from syncrelay.recordings.bag.payloads import ReadMessage, ReadStamp, message_reader, read_ros1_stamp, stamp_reader
from syncrelay.recordings.bag.recording import Channel, Encoding, RawMessage

Nanoseconds: TypeAlias = npt.NDArray[np.int64]
Heads: TypeAlias = npt.NDArray[np.void]
"""The first bytes of each payload, up to the end of a leading Header's stamp."""

_NS_PER_SECOND: Final = 1_000_000_000
# A leading Header's stamp ends here.
_HEAD: Final = 12
# CDR as DDS has it in both byte orders, and ROS 1.
_LITTLE: Final = np.dtype([("kind", "<u2"), ("options", "V2"), ("seconds", "<i4"), ("nanoseconds", "<u4")])
_BIG: Final = np.dtype([("kind", "<u2"), ("options", "V2"), ("seconds", ">i4"), ("nanoseconds", ">u4")])
_ROS1: Final = np.dtype([("seq", "<u4"), ("seconds", "<u4"), ("nanoseconds", "<u4")])
_CDR_BE, _CDR_LE, _CDR2_BE, _CDR2_LE = 0x0000, 0x0100, 0x0600, 0x0700


class Batch:
    """Consecutive messages of a recording, with what is read from all of them at once."""

    def __init__(self, rows: Sequence[RawMessage]) -> None:
        self.rows = rows

    @cached_property
    def received(self) -> Nanoseconds:
        """The receive times."""
        return np.array([received for _, received, _ in self.rows], dtype=np.int64)

    @cached_property
    def heads(self) -> Heads:
        """The first bytes of each payload; a shorter payload gets bytes from which no stamp can be read."""
        heads = [payload[:_HEAD] for _, _, payload in self.rows]
        joined = b"".join(heads)
        if len(joined) != _HEAD * len(heads):
            joined = b"".join([head if len(head) == _HEAD else b"\xff" * _HEAD for head in heads])
        return np.frombuffer(joined, dtype=f"V{_HEAD}")


class Column(NamedTuple):
    """Messages of a batch: their places in it, their stamps (or UNREADABLE), and their keys."""

    places: Places
    stamps: Nanoseconds
    keys: Sequence[Hashable] | None


ReadColumn: TypeAlias = Callable[[Batch, Places], tuple[Nanoseconds, Sequence[Hashable] | None]]
"""From some places of a batch to the stamps (or UNREADABLE) and the keys of its messages."""


def column_reader(group: GroupConfig, index: int, channel: Channel) -> ReadColumn:
    """Return what reads the messages of a channel for one input of a group, as `message_reader` does one by one.

    Raises BagError where the channel's type has no such stamp or key.
    """
    topic = group.topics[index]
    if topic.key is None and (group.restamp is None or topic.stamp == "header"):
        return _stamp_column(topic.stamp, channel)
    return _one_by_one(message_reader(group, index, channel))


def receipt_column(batch: Batch, places: Places) -> tuple[Nanoseconds, None]:
    """Return times of receipt in place of stamps, as a ReadColumn."""
    return batch.received[places], None


def stamp_or_receipt_column(channel: Channel) -> ReadColumn:
    """Return what reads header stamps, or receive times if the type is unknown or has no header."""
    has_header = isinstance(channel.encoding, Encoding) and bool(begins_with_header(channel))
    return _stamp_column("header" if has_header else "receive", channel)


def _stamp_column(source: StampSource, channel: Channel) -> ReadColumn:
    read = stamp_reader(source, channel)
    if read is None:
        return receipt_column
    if read in _IN_ONE_GO:
        read_all = _IN_ONE_GO[read]
        return lambda batch, places: (read_all(batch.heads[places]), None)
    return _one_by_one(lambda raw: (read(raw[2]), None))


def _one_by_one(read: ReadMessage) -> ReadColumn:
    def read_column(batch: Batch, places: Places) -> tuple[Nanoseconds, Sequence[Hashable]]:
        found = [read(batch.rows[place]) for place in places.tolist()]
        stamps = np.array([UNREADABLE if stamp is None else stamp for stamp, _ in found], dtype=np.int64)
        return stamps, [key for _, key in found]

    return read_column


def cdr_stamps(heads: Heads) -> Nanoseconds:
    """Return what `read_stamp` returns for each payload, with UNREADABLE for None."""
    stamps, is_good = _nanoseconds(heads.view(_LITTLE))
    kinds = heads.view(_LITTLE)["kind"]
    is_little = (kinds == _CDR_LE) | (kinds == _CDR2_LE)
    if not is_little.all():
        is_big = (kinds == _CDR_BE) | (kinds == _CDR2_BE)
        big_stamps, big_is_good = _nanoseconds(heads.view(_BIG))
        stamps = np.where(is_big, big_stamps, stamps)
        is_good = np.where(is_big, big_is_good, is_good & is_little)
    return np.where(is_good, stamps, UNREADABLE)


def ros1_stamps(heads: Heads) -> Nanoseconds:
    """Return what `read_ros1_stamp` returns for each payload, with UNREADABLE for None."""
    stamps, is_good = _nanoseconds(heads.view(_ROS1))
    return np.where(is_good & (stamps <= LATEST_STAMP), stamps, UNREADABLE)


def _nanoseconds(times: npt.NDArray[np.void]) -> tuple[Nanoseconds, npt.NDArray[np.bool_]]:
    """Return times in nanoseconds, and which of them have less than a second of nanoseconds."""
    stamps = times["seconds"].astype(np.int64) * _NS_PER_SECOND + times["nanoseconds"]
    return stamps, times["nanoseconds"] < _NS_PER_SECOND


_IN_ONE_GO: Final[Mapping[ReadStamp, Callable[[Heads], Nanoseconds]]] = {
    read_stamp: cdr_stamps,
    read_ros1_stamp: ros1_stamps,
}


class Columns:
    """Reads the batches of a recording for inputs, each of which has one or more channels with their readers.

    Where an input's stamps are of a device's clock, they are mapped by it.
    """

    def __init__(
        self, inputs: Sequence[Sequence[tuple[Channel, ReadColumn]]], clocks: Sequence[DeviceClock | None] = ()
    ) -> None:
        self._clocks = {index: clock for index, clock in enumerate(clocks) if clock is not None}
        self._numbers: dict[Channel, int] = {}
        for channel, _ in chain.from_iterable(inputs):
            self._numbers.setdefault(channel, len(self._numbers))
        self._inputs = [[(self._numbers[channel], read) for channel, read in each] for each in inputs]

    @property
    def channels(self) -> Collection[Channel]:
        """The channels of all inputs."""
        return self._numbers.keys()

    def read(self, batch: Batch) -> Iterator[tuple[int, Column]]:
        """Yield the column of each input that the batch has messages of, by its index."""
        numbers = np.array([self._numbers[channel] for channel, _, _ in batch.rows], dtype=np.intp)
        there = set(np.flatnonzero(np.bincount(numbers)).tolist())
        places = {number: np.flatnonzero(numbers == number) for number in there}
        for index, each in enumerate(self._inputs):
            found = [Column(places[number], *read(batch, places[number])) for number, read in each if number in there]
            if found:
                column, clock = _combined(found), self._clocks.get(index)
                yield index, column if clock is None else _mapped(column, batch, clock)

    def in_order(self, batch: Batch) -> Iterator[tuple[int, RawMessage, int, Hashable]]:
        """Yield the messages of a batch: index of the input, message, stamp (or UNREADABLE), key.

        A message for two inputs is yielded for each, in their order.
        """
        found = dict(self.read(batch))
        if not found:
            return iter(())
        inputs, columns = list(found), list(found.values())
        order, of = by_place([column.places for column in columns])
        whole = _joined(columns, order)
        return zip(
            np.array(inputs)[of].tolist(),
            map(batch.rows.__getitem__, whole.places.tolist()),
            whole.stamps.tolist(),
            whole.keys or repeat(None),
            strict=False,
        )


def _mapped(column: Column, batch: Batch, clock: DeviceClock) -> Column:
    """Return messages with stamps of the host's time; of all channels together, in the order of their receipt."""
    stamps = host_times(clock, column.stamps.tolist(), batch.received[column.places].tolist())
    return column._replace(stamps=np.fromiter(stamps, dtype=np.int64))


def _combined(columns: Sequence[Column]) -> Column:
    """Merge the messages of several channels by their places."""
    if len(columns) == 1:
        return columns[0]
    order, _ = by_place([each.places for each in columns])
    return _joined(columns, order)


def _joined(columns: Sequence[Column], order: Places) -> Column:
    """Concatenate columns and reorder the result."""
    return Column(
        np.concatenate([each.places for each in columns])[order],
        np.concatenate([each.stamps for each in columns])[order],
        joined([(each.keys, len(each.places)) for each in columns], order),
    )
