"""The stamps of a recording, read once: all that the analysis asks for comes from these arrays."""

from array import array
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from syncrelay.bag.definitions import begins_with_header
from syncrelay.bag.payloads import stamp_reader, value_reader
from syncrelay.bag.recording import Channel, Encoding, Recording
from syncrelay.bag.wiring import Wiring
from syncrelay.config import StampSource

Nanoseconds: TypeAlias = npt.NDArray[np.int64]

UNREADABLE = -(2**63)
"""Stands in place of a stamp that could not be read."""


@dataclass(slots=True)
class Stream:
    """One input's messages as they were received: stamps, times of receipt, places in the whole recording, keys."""

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


_Wanted: TypeAlias = tuple[str, StampSource, str | None]
_Take: TypeAlias = Callable[[int, int, bytes], None]


def read_streams(recording: Recording, wirings: Sequence[Wiring]) -> tuple[tuple[Stream, ...], ...]:
    """Read a recording to its end; give a stream for each input of each group.

    Raises BagError for a stamp or key that a recorded type does not have.
    """
    streams: dict[_Wanted, Stream] = {}
    takers: dict[Channel, list[_Take]] = {}
    chosen: list[tuple[Stream, ...]] = []
    for wiring in wirings:
        of_group = []
        for each in wiring.inputs:
            wanted = (each.topic, each.config.stamp, each.config.key)
            if wanted not in streams:
                streams[wanted] = Stream(each.topic, each.config.type, keys=None if each.config.key is None else [])
                for channel in each.channels:
                    taker = _taker(streams[wanted], channel, each.config.stamp, each.config.key)
                    takers.setdefault(channel, []).append(taker)
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
        takers[channel] = [_taker(stream, channel, "header" if _has_stamps(channel) else "receive", None)]
    _pour(recording, takers)
    return tuple(found.values())


def _has_stamps(channel: Channel) -> bool:
    return isinstance(channel.encoding, Encoding) and bool(begins_with_header(channel))


def _pour(recording: Recording, takers: Mapping[Channel, Sequence[_Take]]) -> None:
    for place, (channel, received, payload) in enumerate(recording.messages(takers.keys())):
        for take in takers[channel]:
            take(place, received, payload)


def _taker(stream: Stream, channel: Channel, source: StampSource, key: str | None) -> _Take:
    read_stamp = stamp_reader(source, channel)
    read_key: Callable[[bytes], Any] | None = None if key is None else value_reader(channel, key)

    def take(place: int, received: int, payload: bytes) -> None:
        stamp = received if read_stamp is None else read_stamp(payload)
        stream.stamps.append(UNREADABLE if stamp is None else stamp)
        stream.received.append(received)
        stream.places.append(place)
        if read_key is not None and stream.keys is not None:
            stream.keys.append(read_key(payload))

    return take


def _array(values: "array[int]") -> Nanoseconds:
    return np.frombuffer(values, dtype=np.int64) if values else np.zeros(0, dtype=np.int64)
