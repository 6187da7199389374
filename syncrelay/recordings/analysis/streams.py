"""The stamps of a recording, read once: all that the analysis asks for comes from these columns."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from itertools import repeat
from typing import Any, TypeAlias

import numpy as np

from syncrelay.clock import DeviceClock, Step, host_times
from syncrelay.config import GroupConfig, StampSource
from syncrelay.explain.received import Received
from syncrelay.explain.rows import Column as Numbers
from syncrelay.explain.rows import Rows, blocks, no_numbers
from syncrelay.recordings.bag.bindings import GroupBinding
from syncrelay.recordings.bag.columns import (
    Batch,
    Column,
    Columns,
    Nanoseconds,
    ReadColumn,
    column_reader,
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


@dataclass(frozen=True, slots=True)
class Mapping:
    """How stamps of a device were mapped: as they came, when its clock was set, its last rate and what was taken off.

    Without stamps where a relay had mapped them before they were seen.
    """

    stamps: Numbers = field(default_factory=no_numbers)
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
    stamps: Numbers = field(default_factory=no_numbers)
    received: Numbers = field(default_factory=no_numbers)
    places: Numbers = field(default_factory=no_numbers)
    keys: list[Hashable] | None = None
    mapping: Mapping | None = None
    frames: list[str | None] | None = None
    """The frames of its messages, and the transforms of the recording, for a group that waits for them."""
    transforms: RecordedTransforms | None = None
    mapped: dict[int, "Stream"] = field(default_factory=dict)
    """What by_device gave, by the delay: to map takes as long as to match."""
    kept: dict[str, Any] = field(default_factory=dict)
    """What was found out of its messages."""
    rows: Rows = field(default_factory=lambda: Rows(3))
    """What is read, in the columns of a stream that was `begun`."""
    _read_frame: ReadFrame = field(default_factory=frame_reader)

    @classmethod
    def begun(cls, topic: str, type_name: str, *, has_keys: bool = False) -> "Stream":
        """Return a stream to which messages are added as they are read."""
        rows = Rows(3)
        columns = (rows.column(0), rows.column(1), rows.column(2))
        return cls(topic, type_name, *columns, [] if has_keys else None, rows=rows)

    @classmethod
    def of(cls, topic: str, type_name: str, messages: Sequence[tuple[int, int, int]]) -> "Stream":
        """Return a stream of some messages: stamp, time of receipt and place."""
        columns = np.array(messages, dtype=np.int64).reshape(-1, 3)
        return cls(topic, type_name, columns[:, 0], columns[:, 1], columns[:, 2])

    def by_device(self, delay_ns: int) -> "Stream":
        """Give the same messages with their stamps mapped to the host's time, as `clock: device` has it."""
        if delay_ns not in self.mapped:
            self.mapped[delay_ns] = self._by_device(delay_ns)
        return self.mapped[delay_ns]

    def _by_device(self, delay_ns: int) -> "Stream":
        steps: list[Step] = []
        clock = DeviceClock(delay_ns=delay_ns, stepped=steps.append)
        mapped = Rows(1)
        for stamps, at in zip(blocks(self.stamps), blocks(self.received), strict=True):
            times = host_times(clock, stamps.tolist(), at.tolist())
            mapped.append(np.fromiter(times, dtype=np.int64).reshape(-1, 1))
        mapping = Mapping(self.stamps, tuple(steps), clock.rate, delay_ns)
        return replace(self, stamps=mapped.column(0), mapping=mapping, mapped={}, kept={})

    def by_receipt(self) -> "Stream":
        """Give the same messages with the times of receipt for stamps."""
        return replace(self, stamps=self.received, mapping=None, mapped={}, kept={})

    def arrays(self) -> tuple[Nanoseconds, Nanoseconds, Nanoseconds]:
        """Give stamps, times of receipt and places as whole arrays."""
        return self.stamps[:], self.received[:], self.places[:]

    def as_received(self) -> Received:
        """Give the messages as they arrived, once all are read."""
        received: Received = self.kept.setdefault(
            "received", Received(self.stamps, self.received, self.places, self.keys, self.frames)
        )
        return received

    def add(self, column: Column, batch: Batch, begin: int) -> None:
        """Take messages of a batch, which begins at a place of the recording."""
        self.rows.append(np.stack([column.stamps, batch.received[column.places], column.places + begin], axis=1))
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
                streams[wanted] = Stream.begun(each.topic, topic.type or "", has_keys=topic.key is not None)
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
        (Stream.begun(topic, type_name), [(channel, stamp_or_receipt_column(channel)) for channel in channels])
        for (topic, type_name, _), channels in found.items()
    ]
    _pour(recording, filled)
    return tuple((readers[0][0], stream) for stream, readers in filled)


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
