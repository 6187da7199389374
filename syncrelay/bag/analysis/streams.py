"""The stamps of a recording, read once: all that the analysis asks for comes from these arrays."""

from array import array
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from syncrelay.bag.bindings import GroupBinding
from syncrelay.bag.payloads import ReadMessage, message_reader, stamp_or_receipt_reader
from syncrelay.bag.recording import Channel, Encoding, RawMessage, Recording
from syncrelay.config import StampSource
from syncrelay.explain import Arrival

Nanoseconds: TypeAlias = npt.NDArray[np.int64]

UNREADABLE = -(2**63)
"""Stands in place of a stamp that could not be read."""


@dataclass(slots=True)
class Stream:
    """One input's messages as they were received: stamps, times of receipt, places in the whole recording, keys.

    `type` is empty where the file has none and nothing was recorded.
    """

    topic: str
    type: str
    stamps: "array[int]" = field(default_factory=lambda: array("q"))
    received: "array[int]" = field(default_factory=lambda: array("q"))
    places: "array[int]" = field(default_factory=lambda: array("q"))
    keys: list[Hashable] | None = None

    def by_receipt(self) -> "Stream":
        """Give the same messages with the times of receipt for stamps."""
        return Stream(self.topic, self.type, self.received, self.received, self.places, self.keys)

    def numbers(self) -> tuple[Nanoseconds, Nanoseconds, Nanoseconds]:
        """Give stamps, times of receipt and places as arrays for arithmetic."""
        return _array(self.stamps), _array(self.received), _array(self.places)


_Wanted: TypeAlias = tuple[str, StampSource, str | None, bool]
_Take: TypeAlias = Callable[[int, RawMessage], None]


def read_streams(recording: Recording, bindings: Sequence[GroupBinding]) -> tuple[tuple[Stream, ...], ...]:
    """Read a recording to its end; give a stream for each input of each group.

    Raises BagError for a stamp or key that a recorded type does not have.
    """
    streams: dict[_Wanted, Stream] = {}
    takers: dict[Channel, list[_Take]] = {}
    chosen: list[tuple[Stream, ...]] = []
    for binding in bindings:
        of_group = []
        for index, each in enumerate(binding.inputs):
            topic = each.config
            needs_place = binding.group.restamp is not None and topic.stamp != "header"
            wanted = (each.topic, topic.stamp, topic.key, needs_place)
            if wanted not in streams:
                streams[wanted] = Stream(each.topic, topic.type or "", keys=None if topic.key is None else [])
                for channel in each.channels:
                    read = message_reader(binding.group, index, channel)
                    takers.setdefault(channel, []).append(_taker(streams[wanted], read))
            of_group.append(streams[wanted])
        chosen.append(tuple(of_group))
    _pour(recording, takers)
    return tuple(chosen)


def read_topics(recording: Recording) -> tuple[tuple[Channel, Stream], ...]:
    """Read a recording to its end; give a channel and a stream for each topic and type that it has.

    Stamps are those of the headers; of a topic without, or whose type is not known, the times of receipt.
    """
    found: dict[tuple[str, str, Encoding | str], tuple[Channel, Stream]] = {}
    takers: dict[Channel, list[_Take]] = {}
    for channel in recording.channels:
        first = (channel, Stream(channel.topic, channel.type))
        _, stream = found.setdefault((channel.topic, channel.type, channel.encoding), first)
        takers[channel] = [_taker(stream, stamp_or_receipt_reader(channel))]
    _pour(recording, takers)
    return tuple(found.values())


def arrivals(streams: Sequence[Stream]) -> Iterator[Arrival]:
    """Yield the messages of a group's inputs in the order of the recording."""
    lengths = [len(stream.places) for stream in streams]
    places = np.concatenate([stream.numbers()[2] for stream in streams])
    inputs = np.repeat(np.arange(len(streams)), lengths)
    indexes = np.concatenate([np.arange(length) for length in lengths])
    # Stable: a topic that feeds two inputs feeds them in their order.
    order = np.argsort(places, kind="stable")
    for index, at in zip(inputs[order].tolist(), indexes[order].tolist(), strict=True):
        stream = streams[index]
        stamp = stream.stamps[at]
        key = None if stream.keys is None else stream.keys[at]
        is_unusable = stamp == UNREADABLE or (stream.keys is not None and key is None)
        yield Arrival(index, None if is_unusable else stamp, stream.received[at], key)


def _pour(recording: Recording, takers: Mapping[Channel, Sequence[_Take]]) -> None:
    for place, raw in enumerate(recording.messages(takers.keys())):
        for take in takers[raw[0]]:
            take(place, raw)


def _taker(stream: Stream, read: ReadMessage) -> _Take:
    def take(place: int, raw: RawMessage) -> None:
        stamp, key = read(raw)
        stream.stamps.append(UNREADABLE if stamp is None else stamp)
        stream.received.append(raw[1])
        stream.places.append(place)
        if stream.keys is not None:
            stream.keys.append(key)

    return take


def _array(values: "array[int]") -> Nanoseconds:
    return np.frombuffer(values, dtype=np.int64) if values else np.zeros(0, dtype=np.int64)
