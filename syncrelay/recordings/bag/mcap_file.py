"""MCAP files as recordings."""

from collections.abc import Collection, Iterator
from functools import partial
from typing import Final

from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk

from syncrelay.errors import BagError
from syncrelay.recordings.bag.effort import Effort
from syncrelay.recordings.bag.losses import Losses
from syncrelay.recordings.bag.mcap_index import McapIndex
from syncrelay.recordings.bag.mcap_parts import Parts, is_mixed, is_needed
from syncrelay.recordings.bag.mcap_records import RECORD, UNREADABLE, add_messages, parsed, unpacked
from syncrelay.recordings.bag.qos import read_profiles
from syncrelay.recordings.bag.recording import Channel, Definition, Encoding, RawMessage
from syncrelay.recordings.bag.segments import Segment, extent, read_in_order
from syncrelay.recordings.bag.sources import Source
from syncrelay.recordings.bag.unpacking import NOT_UNPACKED, OF_NO_CONTENT, PACKED, unzstd

# rosbag2 compresses all payloads or none. Damage may hide that of one.
_FEW: Final = 3


class McapFile:
    """One MCAP file, opened for reading; see Recording."""

    def __init__(self, file: Source, name: str) -> None:
        """Read a file that messages call `name`; raises NoIndexError if one behind a URL has no trusted index."""
        self._file = file
        self._losses = Losses(name)
        self.size = file.size
        self.position = 0
        self._effort = Effort()
        self._index = McapIndex(file, self._losses)
        self._by_id = {number: self._channel(record) for number, record in self._index.channels.items()}
        self.channels = tuple(self._by_id.values())
        self.begin, self.end = extent(self._index.segments)

    @property
    def faults(self) -> list[str]:
        """See Recording."""
        return self._losses.sentences

    def batches(self, wanted: Collection[Channel]) -> Iterator[list[RawMessage]]:
        """See Recording."""
        among = frozenset(wanted)
        chosen = {number: channel if channel in among else None for number, channel in self._by_id.items()}
        index = self._index
        by_time = sorted(index.segments, key=lambda each: each.begin)
        needed = [each for each in by_time if is_needed(index.holds.get(each, ()), chosen)]
        self.position = sum(each.size for each in index.segments) - sum(each.size for each in needed)
        parts = None
        if not self._file.is_near:
            plain = {each: chunk for each, chunk in index.plain.items() if is_mixed(index.holds.get(each, ()), chosen)}
            numbers = [number for number, channel in chosen.items() if channel is not None]
            parts = Parts(self._file, needed, plain, numbers)
        self._effort = Effort()
        said, count = self.faults, 0
        read = partial(self._read, channels=chosen, parts=parts)
        for segment, found in read_in_order(needed, read, self._losses):
            self.position += segment.size
            count += len(found)
            yield found
        self.position = self.size
        expected = sum(held for number, held in index.counts.items() if chosen.get(number) is not None)
        if count < expected and said == self.faults:
            self._losses.say(f"the index finds {count} of the {expected} messages in its statistics")

    def close(self) -> None:
        """See Recording."""
        self._file.close()

    def _channel(self, record: ChannelRecord) -> Channel:
        schema = self._index.schemas.get(record.schema_id)
        return Channel(
            record.id,
            record.topic,
            schema.name if schema else "",
            record.message_encoding,
            Definition(schema.encoding, schema.data.decode(errors="replace")) if schema and schema.data else None,
            read_profiles(record.metadata.get("offered_qos_profiles", "")),
            record.metadata.get("topic_type_hash", ""),
        )

    def _read(self, segment: Segment, channels: dict[int, Channel | None], parts: Parts | None) -> list[RawMessage]:
        found: list[RawMessage] = []
        try:
            content = parts.of(segment) if parts is not None else None
            add_messages(found, self._content(segment) if content is None else content, channels, self._effort)
        except UNREADABLE as fault:
            if found:
                self._effort.found_message()
            self._losses.damaged(f"the chunk at byte {segment.offset}", fault, read=len(found))
        return [*self._unpacked(found)] if any(map(_is_packed, found[:_FEW])) else found

    def _unpacked(self, found: list[RawMessage]) -> Iterator[RawMessage]:
        for message in found:
            if not _is_packed(message):
                yield message
                continue
            channel, time, payload = message
            try:
                content = unzstd(payload, self._effort)
            except NOT_UNPACKED:
                self._losses.leave_out(OF_NO_CONTENT)
                continue
            self._effort.found_message()
            yield channel, time, content

    def _content(self, segment: Segment) -> bytes:
        if segment not in self._index.chunked:
            return self._file.read(segment.offset, segment.size)
        opcode, length = RECORD.unpack(self._file.read(segment.offset, RECORD.size))
        if opcode != Opcode.CHUNK or length != segment.size - RECORD.size:
            raise ValueError("it does not match the index")
        return unpacked(parsed(Chunk, self._file.read(segment.offset + RECORD.size, length)), self._effort)


def _is_packed(message: RawMessage) -> bool:
    channel, _, payload = message
    return payload.startswith(PACKED) and channel.encoding is Encoding.CDR


def open_mcap(source: Source, name: str) -> McapFile:
    """Open an MCAP file; raises BagError if nothing of a damaged one can be read, and NoIndexError as McapFile does."""
    file = McapFile(source, name)
    if file.faults and not file.channels:
        file.close()
        raise BagError(f"{name}: no message can be read: {file.faults[0]}")
    return file
