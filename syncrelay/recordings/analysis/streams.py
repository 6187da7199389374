"""The stamps of a recording, read once: all that the analysis asks for comes from these arrays."""

from array import array
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import repeat
from typing import Any, Final, TypeAlias

import numpy as np

from syncrelay.clock import DeviceClock, Step, host_times
from syncrelay.config import GroupConfig, StampSource
from syncrelay.recordings.bag.bindings import GroupBinding
from syncrelay.recordings.bag.columns import (
    Batch,
    Column,
    Columns,
    Nanoseconds,
    ReadColumn,
    column_reader,
    in_order,
    keys_in_order,
    receipt_column,
    stamp_or_receipt_column,
)
from syncrelay.recordings.bag.recording import Channel, Encoding, Recording
from syncrelay.recordings.bag.transforms import (
    ReadFrame,
    RecordedTransforms,
    TransformReader,
    frame_reader,
    transform_channels,
)
from syncrelay.sync import Message

# So many messages of a group are made at a time.
_AT_ONCE: Final = 10_000


@dataclass(frozen=True, slots=True)
class Mapping:
    """How stamps of a device were mapped: as they came, when its clock was set, its last rate and what was taken off.

    Without stamps where a relay had mapped them before they were seen.
    """

    stamps: "array[int]" = field(default_factory=lambda: array("q"))
    steps: tuple[Step, ...] = ()
    rate: float = 0.0
    delay_ns: int = 0


@dataclass(slots=True)
class Stream:
    """One input's messages as they were received: stamps, times of receipt, places in the whole recording, keys.

    Where no stamp or no key could be read, the stamp is UNREADABLE. `type` is empty where the file has none and nothing
    was recorded.
    """

    topic: str
    type: str
    stamps: "array[int]" = field(default_factory=lambda: array("q"))
    received: "array[int]" = field(default_factory=lambda: array("q"))
    places: "array[int]" = field(default_factory=lambda: array("q"))
    keys: list[Hashable] | None = None
    mapping: Mapping | None = None
    frames: list[str | None] | None = None
    """The frames of its messages, and the transforms of the recording, for a group that waits for them."""
    transforms: RecordedTransforms | None = None
    mapped: dict[int, "Stream"] = field(default_factory=dict)
    """What by_device gave, by the delay: to map takes as long as to match."""
    _read_frame: ReadFrame = field(default_factory=frame_reader)

    def by_device(self, delay_ns: int) -> "Stream":
        """Give the same messages with their stamps mapped to the host's time, as `clock: device` has it."""
        if delay_ns not in self.mapped:
            self.mapped[delay_ns] = self._by_device(delay_ns)
        return self.mapped[delay_ns]

    def _by_device(self, delay_ns: int) -> "Stream":
        steps: list[Step] = []
        clock = DeviceClock(delay_ns=delay_ns, stepped=steps.append)
        mapped = array("q", host_times(clock, self.stamps, self.received))
        mapping = Mapping(self.stamps, tuple(steps), clock.rate, delay_ns)
        return replace(self, stamps=mapped, mapping=mapping, mapped={})

    def by_receipt(self) -> "Stream":
        """Give the same messages with the times of receipt for stamps."""
        return replace(self, stamps=self.received, mapping=None, mapped={})

    def numbers(self) -> tuple[Nanoseconds, Nanoseconds, Nanoseconds]:
        """Give stamps, times of receipt and places as arrays for arithmetic."""
        return _array(self.stamps), _array(self.received), _array(self.places)

    def add(self, column: Column, batch: Batch, begin: int) -> None:
        """Take messages of a batch, which begins at a place of the recording."""
        self.stamps.frombytes(column.stamps.tobytes())
        self.received.frombytes(batch.received[column.places].tobytes())
        self.places.frombytes((column.places + begin).tobytes())
        if self.keys is not None:
            self.keys += column.keys or repeat(None, len(column.places))
        if self.frames is not None:
            self.frames += map(self._read_frame, map(batch.rows.__getitem__, column.places.tolist()))


_Wanted: TypeAlias = tuple[str, StampSource, str | None, bool, bool]
_Filled: TypeAlias = list[tuple[Stream, list[tuple[Channel, ReadColumn]]]]


def read_streams(recording: Recording, bindings: Sequence[GroupBinding]) -> tuple[tuple[Stream, ...], ...]:
    """Read a recording to its end; give a stream for each input of each group.

    Raises BagError for a stamp or key that a recorded type does not have.
    """
    streams: dict[_Wanted, Stream] = {}
    filled: _Filled = []
    chosen: list[list[Stream]] = []
    transforms = RecordedTransforms()
    for binding in bindings:
        of_group = []
        awaits = binding.group.options.transforms is not None
        for index, each in enumerate(binding.inputs):
            topic = each.config
            needs_place = binding.group.restamp is not None and topic.stamp != "header"
            wanted = (each.topic, topic.stamp, topic.key, needs_place, awaits)
            if wanted not in streams:
                streams[wanted] = Stream(each.topic, topic.type or "", keys=None if topic.key is None else [])
                if awaits:
                    streams[wanted].frames, streams[wanted].transforms = [], transforms
                readers = [(channel, column_reader(binding.group, index, channel)) for channel in each.channels]
                filled.append((streams[wanted], readers))
            of_group.append(streams[wanted])
        chosen.append(of_group)
    _pour(recording, filled, transforms if any(stream.frames is not None for stream in streams.values()) else None)
    return tuple(
        tuple(
            stream.by_device(topic.delay_ns) if topic.is_of_device else stream
            for stream, topic in zip(of_group, binding.group.topics, strict=True)
        )
        for binding, of_group in zip(bindings, chosen, strict=True)
    )


def read_topics(recording: Recording) -> tuple[tuple[Channel, Stream], ...]:
    """Read a recording to its end; give a channel and a stream for each topic and type that it has.

    Stamps are those of the headers; of a topic without, or whose type is not known, the times of receipt.
    """
    found: dict[tuple[str, str, Encoding | str], list[Channel]] = {}
    for channel in recording.channels:
        found.setdefault((channel.topic, channel.type, channel.encoding), []).append(channel)
    filled: _Filled = [
        (Stream(topic, type_name), [(channel, stamp_or_receipt_column(channel)) for channel in channels])
        for (topic, type_name, _), channels in found.items()
    ]
    _pour(recording, filled)
    return tuple((readers[0][0], stream) for stream, readers in filled)


def messages(streams: Sequence[Stream]) -> Iterator[Message]:
    """Yield the messages of a group's inputs in the order of the recording; the payload is the time of receipt."""
    numbers = [stream.numbers() for stream in streams]
    places = [places for _, _, places in numbers]
    order, inputs = in_order(places)
    stamps, received = (np.concatenate([each[column] for each in numbers])[order] for column in (0, 1))
    keys = iter(keys_in_order([(stream.keys, len(stream.places)) for stream in streams], order) or repeat(None))
    frames: Iterator[Any] = iter(
        keys_in_order([(stream.frames, len(stream.places)) for stream in streams], order) or repeat(None)
    )
    for begin in range(0, len(order), _AT_ONCE):
        among = slice(begin, begin + _AT_ONCE)
        yield from map(Message, inputs[among].tolist(), stamps[among].tolist(), received[among].tolist(), keys, frames)


def transforms_beside(streams: Sequence[Stream]) -> RecordedTransforms | None:
    """Return the transforms for which the sets of a group wait; None where it waits for none."""
    return next((stream.transforms for stream in streams if stream.transforms is not None), None)


def stamped(group: GroupConfig, streams: Sequence[Stream]) -> list[Stream]:
    """Return the streams with times of receipt, or mapped stamps, where the group goes by them."""
    return [
        stream.by_receipt()
        if topic.stamp == "receive"
        else stream.by_device(topic.delay_ns)
        if topic.is_of_device and stream.mapping is None
        else stream
        for topic, stream in zip(group.topics, streams, strict=True)
    ]


def _pour(recording: Recording, filled: _Filled, transforms: RecordedTransforms | None = None) -> None:
    channels = [] if transforms is None else transform_channels(recording)
    reader = TransformReader(channels)
    columns = Columns([*(readers for _, readers in filled), [(channel, receipt_column) for channel in channels]])
    begin = 0
    for batch in map(Batch, recording.batches(columns.channels)):
        for index, column in columns.read(batch):
            if index < len(filled):
                filled[index][0].add(column, batch, begin)
            elif transforms is not None:
                for raw in map(batch.rows.__getitem__, column.places.tolist()):
                    transforms.add(reader.read(raw), raw[1])
        begin += len(batch.rows)


def _array(values: "array[int]") -> Nanoseconds:
    return np.frombuffer(values, dtype=np.int64) if values else np.zeros(0, dtype=np.int64)
