"""Sets of a group as rows of a table: their times, and the message of each input.

Columns: `set` (from 1), `stamp` (the common stamp of restamping, else the tick of the clock that triggered the set,
else the newest stamp), `left_at`, `span_ns` (with the inputs' offsets), `latency_ns` (from receiving the last message
of the set), `recording`, `stamps` and `received` (structs with a field for each input), and a column for each input,
named as its topic, which is null where the set lacks an optional input. Times are timestamps in nanoseconds, in UTC
if the clock of the recording counts from 1970.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

import pyarrow as pa
import pyarrow.compute as pc
from rosbags.typesys.store import Typestore

from syncrelay import own_version
from syncrelay.config.wording import counted
from syncrelay.errors import BagError
from syncrelay.recordings.bag.bindings import GroupBinding, Input
from syncrelay.recordings.bag.definitions import typestore
from syncrelay.recordings.bag.mcap_output import Compression
from syncrelay.recordings.bag.recording import Channel, Definition
from syncrelay.recordings.bag.replay import Left, received
from syncrelay.recordings.bag.writing import Outgoing, outgoing
from syncrelay.recordings.datasets.decoding import Decoder
from syncrelay.recordings.datasets.images import IMAGE, NEEDED, ImageColumn, ImageFormat
from syncrelay.recordings.datasets.message_types import arrow_type
from syncrelay.sync import Match, Message

_LARGEST: Final = 2**63 - 1
_TIME: Final = pa.timestamp("ns", tz="UTC")
METADATA: Final = b"syncrelay"
"""The key of a schema's metadata under which a JSON document says what the table is made of."""

_CLOUD: Final = "sensor_msgs/msg/PointCloud2"
Fields: TypeAlias = Mapping[str, Sequence[str]]
"""Dotted paths of fields, by an input's full name. An input that is not in it has all its fields."""

Images: TypeAlias = Mapping[str, ImageFormat]
"""The format that an input's images are encoded in, by its full name."""


@dataclass(frozen=True, slots=True)
class Content:
    """What of messages is in a table: which fields, images as PNG or JPEG, or with `raw` whole payloads."""

    fields: Fields = field(default_factory=dict)
    images: Images = field(default_factory=dict)
    other_images: ImageFormat | None = None
    """The format of the images of all other inputs; None leaves raw pixels."""
    raw: bool = False
    compression: Compression = "zstd"
    """How the columns of a Parquet file are packed, but for pictures."""


class SetTable:
    """Gathers the sets of one group until they are taken as a table. `take` is a listener of a replay."""

    def __init__(self, binding: GroupBinding, content: Content, *, recording: str) -> None:
        """`recording` is the value of the column of that name.

        Raises BagError for a type that the recording does not define and for fields that it does not have.
        """
        self.binding: Final = binding
        self.bytes = 0
        """How many bytes the gathered messages have."""
        self.count = 0
        """How many sets are in tables so far."""
        self._recording = recording
        self._columns = [_InputColumn(each, content) for each in binding.inputs]
        self._offsets = [each.config.offset_ns for each in binding.inputs]
        self._matches: list[Match] = []
        self._left: list[int] = []
        self._schema: pa.Schema | None = None

    def take(self, left: Sequence[Left]) -> None:
        """Gather the sets of this group."""
        for binding, outcomes, now in left:
            for outcome in outcomes if binding is self.binding else ():
                if isinstance(outcome, Match):
                    self._matches.append(outcome)
                    self._left.append(now)
                    self.bytes += sum([len(each.payload[2]) for each in outcome.messages if each is not None])

    @property
    def gathered(self) -> int:
        """How many sets are gathered."""
        return len(self._matches)

    def table(self) -> pa.Table:
        """Return the gathered sets, and begin anew."""
        matches, left = self._matches, self._left
        self._matches, self._left, self.bytes = [], [], 0
        numbers = range(self.count + 1, self.count + 1 + len(matches))
        self.count += len(matches)
        stamps = [match.stamps for match in matches]
        arrivals = [[None if each is None else received(each) for each in match.messages] for match in matches]
        names = [each.topic for each in self.binding.inputs]
        columns = {
            "set": pa.array(numbers, pa.int64()),
            "stamp": pa.array(map(_stamp_of, matches), _TIME),
            "left_at": pa.array(left, _TIME),
            "span_ns": pa.array(map(self._span, stamps), pa.int64()),
            "latency_ns": pa.array(
                [at - max(each for each in some if each is not None) for at, some in zip(left, arrivals, strict=True)],
                pa.int64(),
            ),
            "recording": pa.DictionaryArray.from_arrays(
                pa.array([0] * len(matches), pa.int32()), pa.array([self._recording])
            ),
            "stamps": _times(names, stamps),
            "received": _times(names, arrivals),
        }
        for index, column in enumerate(self._columns):
            columns[column.topic] = column.column([(match.messages[index], match.stamp) for match in matches])
        whole = pa.table(columns)
        if self._schema is None:
            self._schema = self._described(whole)
        return pa.Table.from_arrays(whole.columns, schema=self._schema)

    def undecodable(self) -> Iterator[str]:
        """Yield a sentence for each input of which messages could not be decoded."""
        for column in self._columns:
            if column.undecodable:
                lost = counted(column.undecodable, "message")
                yield f"{column.topic}: {lost} could not be decoded as {column.type}, their cells are null"

    def _span(self, stamps: Sequence[int | None]) -> int | None:
        """Return the span of a set; None where it takes more than 64 bits, as between equal keys and centuries."""
        matched = [stamp + offset for stamp, offset in zip(stamps, self._offsets, strict=True) if stamp is not None]
        span = max(matched) - min(matched)
        return span if span <= _LARGEST else None

    def _described(self, table: pa.Table) -> pa.Schema:
        """Return the schema of this and all following tables, with metadata about the inputs."""
        group = self.binding.group
        about: dict[str, Any] = {"version": own_version(), "group": group.name, "policy": group.options.policy}
        about["inputs"] = {column.topic: column.described(table[column.topic]) for column in self._columns}
        schema = table.schema
        for index, name in enumerate(schema.names):
            if name in about["inputs"]:
                texts = {key: value for key, value in about["inputs"][name].items() if isinstance(value, str)}
                schema = schema.set(index, schema.field(index).with_metadata(texts))
        return schema.with_metadata({METADATA: json.dumps(about)})


class _InputColumn:
    """One input's messages."""

    def __init__(self, each: Input, content: Content) -> None:
        self.topic: Final = each.topic
        self.type: Final = each.config.type or ""
        self._offset = each.config.offset_ns
        self._outgoing: dict[Channel, Outgoing] = {channel: outgoing(each, channel) for channel in each.channels}
        self._decoders: dict[Channel | None, Decoder] = {}
        self._undecodable = 0
        self._images: ImageColumn | None = None
        self.arrow: pa.DataType = pa.binary() if content.raw else pa.null()
        if content.raw:
            return
        if each.topic in content.images and self.type not in (IMAGE, ""):
            raise BagError(f"{each.topic} is {self.type}, expected {IMAGE}: --images does not go with it")
        paths = content.fields.get(each.topic)
        if paths is not None and not paths:
            # Without fields the column is of nulls, and messages of any type will do.
            return
        image_format = content.images.get(each.topic, content.other_images)
        if image_format is not None and self.type == IMAGE and (paths is None or "data" in paths):
            self._images = ImageColumn(each.topic, image_format)
        stores: dict[Channel | None, Typestore] = {
            channel: self._store(channel.type, channel.definition) for channel in each.channels
        }
        if not stores and self.type and typestore(self.type, None) is not None:
            # The column of nulls has the type that the file names.
            stores = {None: self._store(self.type, None)}
        if not stores:
            return
        self._decoders = self._made_decoders(stores, paths)
        self.arrow, *others = {decoder.arrow: None for decoder in self._decoders.values()}
        if others:
            raise BagError(
                f"{self.topic} was recorded with two definitions of {self.type}: use --raw, or --fields with fields"
                " that are the same in both"
            )
        if self._images is not None:
            asked = frozenset(paths or [field.name for field in self.arrow])
            self.arrow = self._images.arrow(self.arrow, asked)

    @property
    def undecodable(self) -> int:
        """How many messages of sets could not be decoded, and are null."""
        images = 0 if self._images is None else self._images.undecodable
        return self._undecodable + images + sum(each.undecodable for each in set(self._decoders.values()))

    def column(self, messages: Sequence[tuple[Message | None, int | None]]) -> pa.ChunkedArray:
        """Return a column of messages, each given with the common stamp of its set."""
        if pa.types.is_null(self.arrow):
            return pa.chunked_array([pa.nulls(len(messages))])
        payloads = [None if message is None else self._payload(message, stamp) for message, stamp in messages]
        if not self._decoders:
            return pa.chunked_array([pa.array(payloads, type=self.arrow)])
        found = self._decoded([None if message is None else message.payload[0] for message, _ in messages], payloads)
        return found if self._images is None else self._images.encode(found, self.arrow)

    def described(self, column: pa.ChunkedArray) -> dict[str, Any]:
        """Return metadata about the input: its type, and the frame and the fields of its first message."""
        about: dict[str, Any] = {"type": self.type, "offset_ns": self._offset}
        first = next((row.as_py() for row in column if row.is_valid), None)
        if isinstance(first, dict):
            frame = (first.get("header") or {}).get("frame_id")
            if frame is not None:
                about["frame_id"] = frame
            if self.type == _CLOUD and first.get("fields") is not None:
                about["fields"] = json.dumps(first["fields"])
        return about

    def _made_decoders(
        self, stores: Mapping[Channel | None, Typestore], paths: Sequence[str] | None
    ) -> dict[Channel | None, Decoder]:
        """Return a decoder for each channel; equal definitions share one."""
        needed = paths if paths is None or self._images is None else [*paths, *NEEDED]
        made: dict[pa.StructType, Decoder] = {}
        decoders: dict[Channel | None, Decoder] = {}
        for channel, store in stores.items():
            whole = arrow_type(store, self.type, topic=self.topic)
            if whole not in made:
                made[whole] = Decoder(whole, arrow_type(store, self.type, needed, topic=self.topic))
            decoders[channel] = made[whole]
        return decoders

    def _decoded(self, channels: Sequence[Channel | None], payloads: Sequence[bytes | None]) -> pa.ChunkedArray:
        decoders = [*set(self._decoders.values())]
        if len(decoders) == 1:
            return decoders[0].decode(payloads)
        # Each decodes the messages of its own definition, and gives null for the others.
        columns = [
            decoder.decode(
                [
                    payload if self._decoders.get(channel) is decoder else None
                    for channel, payload in zip(channels, payloads, strict=True)
                ]
            ).combine_chunks()
            for decoder in decoders
        ]
        return pa.chunked_array([pc.coalesce(*columns)])

    def _payload(self, message: Message, stamp: int | None) -> bytes | None:
        channel, _, recorded = message.payload
        try:
            return self._outgoing[channel].written(recorded, stamp)
        except BagError:
            self._undecodable += 1
            return None

    def _store(self, type_name: str, definition: Definition | None) -> Typestore:
        store = typestore(type_name, definition)
        if store is None:
            raise BagError(
                f"{self.topic}: the recording does not define {type_name}, so it cannot be decoded: use --raw, which"
                " keeps the bytes"
            )
        return store


def _stamp_of(match: Match) -> int:
    stamp = match.tick if match.stamp is None else match.stamp
    return max([each for each in match.stamps if each is not None]) if stamp is None else stamp


def _times(names: Sequence[str], rows: Sequence[Sequence[int | None]]) -> pa.StructArray:
    by_input = zip(*rows, strict=True) if rows else [()] * len(names)
    return pa.StructArray.from_arrays([pa.array(each, _TIME) for each in by_input], names=list(names))
