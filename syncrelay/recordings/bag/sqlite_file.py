"""rosbag2's sqlite3 files, read by SQL. The write-ahead log that a killed recorder left is read too.

sqlite3 stores values of any type in any column: rows with a wrong type are left out.
"""

import os
import reprlib
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from syncrelay.errors import BagError
from syncrelay.recordings.bag.effort import Effort
from syncrelay.recordings.bag.losses import OF_NO_CHANNEL, OF_NO_TIME, Losses
from syncrelay.recordings.bag.qos import read_profiles
from syncrelay.recordings.bag.recording import LATEST, Channel, Definition, RawMessage, batched
from syncrelay.recordings.bag.unpacking import NOT_UNPACKED, OF_NO_CONTENT, PACKED, unzstd

MAGIC: Final = b"SQLite format 3\0"
"""What every sqlite3 file begins with."""

# This includes rows of unknown topics, so that they are reported.
_BY_TIME: Final = """
SELECT topic_id, timestamp, data FROM messages WHERE (topic_id IS NULL OR topic_id NOT IN ({})) ORDER BY timestamp"""
# sqlite3 answers this by the index of timestamps, without a scan.
_END_OF: Final = """
SELECT timestamp FROM messages WHERE timestamp BETWEEN 0 AND ? AND typeof(timestamp) = 'integer'
ORDER BY timestamp {} LIMIT 1"""
_FIRST_PAYLOADS: Final = "SELECT data FROM messages WHERE typeof(data) = 'blob' LIMIT 3"
_TABLES: Final = ("topics", "messages", "message_definitions")
_KIND: Final = "SELECT DISTINCT type FROM pragma_table_list WHERE name = ? COLLATE NOCASE AND schema = 'main'"
# The column of table_xinfo that is not 0 for generated columns.
_HIDDEN: Final = 6
# ValueError: an error text of sqlite3 that quotes a damaged name is no valid UTF-8.
_UNREADABLE: Final = (sqlite3.Error, ValueError, MemoryError)
# A row has at least ten bytes and takes some tens of steps; an endless view, or pages in a circle, take more.
_STEPS_PER_BYTE: Final = 50
_STEPS_AT_ONCE: Final = 1_000_000


class SqliteFile:
    """One sqlite3 file of a rosbag2 recording, opened for reading; see Recording."""

    def __init__(self, path: Path, name: str) -> None:
        """Open a file that messages call `name`; raises BagError if it is no recording."""
        self._losses = Losses(name)
        self.size = path.stat().st_size
        self.position = 0
        self._database, self._stored = _opened(path, name)
        try:
            self._require_tables()
            self.channels = tuple(self._channels())
            # sorted: with a damaged index the first time may be the later one.
            self.begin, self.end = sorted(self._end(order) for order in ("ASC", "DESC"))
            first = self._database.execute(_FIRST_PAYLOADS)
            self._is_packed = any(payload.startswith(PACKED) for (payload,) in first)
        except _UNREADABLE as fault:
            self._database.close()
            raise BagError(f"{name}: cannot be read as a rosbag2 recording: {fault}") from fault

    @property
    def faults(self) -> list[str]:
        """See Recording."""
        return self._losses.sentences

    def batches(self, wanted: Collection[Channel]) -> Iterator[list[RawMessage]]:
        """See Recording."""
        return batched(self._messages(wanted))

    def close(self) -> None:
        """See Recording."""
        self._database.close()

    def _messages(self, wanted: Collection[Channel]) -> Iterator[RawMessage]:
        among = frozenset(wanted)
        chosen = {channel.id: channel for channel in self.channels if channel in among}
        others = [channel.id for channel in self.channels if channel.id not in chosen]
        effort, stored, leave_out = Effort(), 0, self._losses.leave_out
        query = _BY_TIME.format(", ".join("?" * len(others)))
        try:
            for number, time, payload in self._database.execute(query, others):
                channel = chosen.get(number)
                if channel is None or type(time) is not int or type(payload) is not bytes or not 0 <= time <= LATEST:
                    leave_out(_why(channel, time, payload))
                    continue
                self.position += len(payload)
                stored += len(payload)
                self._require_stored(stored)
                try:
                    content = unzstd(payload, effort) if self._is_packed else payload
                except NOT_UNPACKED:
                    leave_out(OF_NO_CONTENT)
                    continue
                effort.found_message()
                yield channel, time, content
        except _UNREADABLE as fault:
            self._losses.say(f"damaged; read as far as possible: {fault or 'there is not enough memory'}")
        self.position = self.size

    def _require_tables(self) -> None:
        """Raise ValueError for views and generated columns, which may compute rows without end."""
        for name in _TABLES:
            kinds = self._database.execute(_KIND, (name,)).fetchall()
            columns = self._database.execute(f"PRAGMA table_xinfo({name})")
            if kinds not in ([], [("table",)]) or any(column[_HIDDEN] for column in columns):
                raise ValueError(f"{name} is no plain table")

    def _channels(self) -> Iterator[Channel]:
        columns = {row[1] for row in self._database.execute("PRAGMA table_info(topics)")}
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        type_hash = "type_description_hash" if "type_description_hash" in columns else "''"
        definitions = dict(self._definitions())
        query = f"SELECT id, name, type, serialization_format, {qos}, {type_hash} FROM topics"  # noqa: S608  columns
        for number, topic, type_name, encoding, profiles, hashed in self._described(query):
            if type(number) is not int or not all(isinstance(each, str) for each in (topic, type_name, encoding)):
                described = ", ".join(map(reprlib.repr, (number, topic, type_name, encoding)))
                self._losses.say(f"a topic is left out: expected a number, a name, a type and an encoding: {described}")
                continue
            yield Channel(
                number,
                topic,
                type_name,
                encoding,
                definitions.get(type_name),
                read_profiles(profiles) if isinstance(profiles, str) else (),
                hashed if isinstance(hashed, str) else "",
            )

    def _definitions(self) -> Iterator[tuple[str, Definition]]:
        # Newer than the first versions of rosbag2.
        with suppress(sqlite3.OperationalError):
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            for type_name, encoding, text in self._described(query):
                if all(isinstance(each, str) for each in (type_name, encoding, text)):
                    yield type_name, Definition(encoding, text)

    def _described(self, query: str) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of a descriptive table; raises ValueError if they hold more bytes than the file."""
        size = 0
        for row in self._database.execute(query):
            size += sum(len(each) for each in row if isinstance(each, str | bytes))
            self._require_stored(size)
            yield row

    def _require_stored(self, size: int) -> None:
        """Raise ValueError for more bytes than the file has, which happens if its pages form a circle."""
        if size > self._stored:
            raise ValueError("its tables hold more than the file")

    def _end(self, order: str) -> int:
        """Return the first or the last time of receipt, 0 if there is none."""
        row = self._database.execute(_END_OF.format(order), (LATEST,)).fetchone()
        return int(row[0]) if row else 0


def _why(channel: Channel | None, time: object, payload: object) -> str:
    """Return why a row is no message."""
    if channel is None:
        return OF_NO_CHANNEL
    if type(time) is not int:
        return "the time of receipt is not an integer"
    return "the payload is not a BLOB" if type(payload) is not bytes else OF_NO_TIME


def _opened(path: Path, name: str) -> tuple[sqlite3.Connection, int]:
    """Open a file without changing it or its log; return it, and how many bytes there are to read."""
    log = path.with_name(f"{path.name}-wal")
    # sqlite3 reads the log only if it can write an index beside it; immutable files are read without the log.
    is_logged = log.exists() and os.access(path.parent, os.W_OK)
    mode = "mode=ro" if is_logged else "mode=ro&immutable=1"
    try:
        database = sqlite3.connect(f"file:{quote(str(path.absolute()))}?{mode}", uri=True)
    except sqlite3.Error as fault:
        raise BagError(f"{name}: cannot be opened: {fault}") from fault
    database.text_factory = lambda text: text.decode(errors="replace")
    size = path.stat().st_size + (log.stat().st_size if is_logged else 0)
    left = iter(range(1 + _STEPS_PER_BYTE * size // _STEPS_AT_ONCE))
    database.set_progress_handler(lambda: next(left, None) is None, _STEPS_AT_ONCE)
    return database, size
