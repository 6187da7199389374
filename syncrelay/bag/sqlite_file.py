"""rosbag2's sqlite3 files, by SQL. What a recorder that was killed left in the write-ahead log is read too."""

import os
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final
from urllib.parse import quote

import zstandard

from syncrelay.bag.qos import read_profiles
from syncrelay.bag.recording import Channel, Definition, Encoding, RawMessage
from syncrelay.errors import BagError

MAGIC: Final = b"SQLite format 3\0"
"""What every sqlite3 file begins with."""

_ZSTD: Final = b"\x28\xb5\x2f\xfd"
_BY_TIME: Final = "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({}) ORDER BY timestamp"
_ENCODINGS: Final[dict[str, Encoding | str]] = {each.value: each for each in Encoding}


class SqliteFile:
    """One sqlite3 file of a rosbag2 recording, opened for reading; see Recording."""

    def __init__(self, path: Path, name: str) -> None:
        """Open a file that messages call `name`; raises BagError where it is no recording."""
        self._name = name
        self.faults: list[str] = []
        self.size = path.stat().st_size
        self.position = 0
        self._database = _opened(path, name)
        try:
            self.channels = tuple(self._channels())
            # Both ends of an index: no scan.
            self.begin = self._first("SELECT min(timestamp) FROM messages") or 0
            self.end = self._first("SELECT max(timestamp) FROM messages") or 0
            self._is_compressed = bytes(self._first("SELECT data FROM messages LIMIT 1") or b"").startswith(_ZSTD)
        except sqlite3.Error as fault:
            self._database.close()
            raise BagError(f"{name}: cannot be read as a rosbag2 recording: {fault}") from fault

    def messages(self, wanted: Collection[Channel]) -> Iterator[RawMessage]:
        """See Recording."""
        among = frozenset(wanted)
        chosen = {channel.id: channel for channel in self.channels if channel in among}
        rows = self._database.execute(_BY_TIME.format(", ".join(map(str, chosen))))
        unpack = zstandard.ZstdDecompressor().decompress
        try:
            for number, time, payload in rows:
                self.position += len(payload)
                yield chosen[number], time, unpack(payload) if self._is_compressed else payload
        except (sqlite3.Error, zstandard.ZstdError) as fault:
            self.faults.append(f"{self._name}: damaged, what could be read is read: {fault}")
        self.position = self.size

    def close(self) -> None:
        """See Recording."""
        self._database.close()

    def _channels(self) -> Iterator[Channel]:
        columns = {row[1] for row in self._database.execute("PRAGMA table_info(topics)")}
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        type_hash = "type_description_hash" if "type_description_hash" in columns else "''"
        definitions = dict(self._definitions())
        query = f"SELECT id, name, type, serialization_format, {qos}, {type_hash} FROM topics"  # noqa: S608  columns
        for number, topic, type_name, encoding, profiles, hashed in self._database.execute(query):
            yield Channel(
                number,
                topic,
                type_name,
                _ENCODINGS.get(encoding, encoding),
                definitions.get(type_name),
                read_profiles(profiles),
                hashed,
            )

    def _definitions(self) -> Iterator[tuple[str, Definition]]:
        # Newer than the first versions of rosbag2.
        with suppress(sqlite3.OperationalError):
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            for type_name, encoding, text in self._database.execute(query):
                yield type_name, Definition(encoding, text)

    def _first(self, query: str) -> int | None:
        row = self._database.execute(query).fetchone()
        return row[0] if row else None


def _opened(path: Path, name: str) -> sqlite3.Connection:
    """Open a file without changing it or what is beside it."""
    log = path.with_name(f"{path.name}-wal")
    # A log is read only where its index can be made beside it; immutable files are read without it.
    mode = "mode=ro" if log.exists() and os.access(path.parent, os.W_OK) else "mode=ro&immutable=1"
    try:
        return sqlite3.connect(f"file:{quote(str(path.absolute()))}?{mode}", uri=True)
    except sqlite3.Error as fault:
        raise BagError(f"{name}: cannot be opened: {fault}") from fault
