"""Recordings that take more than they hold, drawn at random: bombs, empty tails, endless tables."""

# ruff: noqa: S608  the SQL is of ours

import bz2
import gzip
import random
import sqlite3
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionMode

from tests.recordings.bag.making import rig, write_mcap, write_ros1, write_rosbag2
from tests.ros.frames import Frame

FRAMES = rig(12)
LONGEST_RECORD = 2000
"""No record is longer, before a recording is changed."""

_MCAP_MAGIC, _ROS1_MAGIC = 8, 13
_Packer: TypeAlias = Callable[[bytes], bytes]


def zstd_piecewise(content: bytes) -> bytes:
    """Return a zstd frame without a size in its header."""
    stream = zstandard.ZstdCompressor().compressobj()
    return stream.compress(content) + stream.flush()


_MCAP_PACKERS: dict[str, tuple[str, _Packer]] = {
    "not packed": ("", bytes),
    "lz4": ("lz4", lz4.frame.compress),
    "zstd": ("zstd", zstandard.compress),
    "zstd that tells no size": ("zstd", zstd_piecewise),
}
_ROS1_PACKERS: dict[str, tuple[str, _Packer]] = {
    "not packed": ("none", bytes),
    "lz4": ("lz4", lz4.frame.compress),
    "bz2": ("bz2", bz2.compress),
}
_FILE_PACKERS: dict[str, _Packer] = {"bz2": bz2.compress, "zst": zstandard.compress, "gz": gzip.compress}


_VIEW, _GENERATED, _DEFAULT = "a view", "a generated column", "a default in place of what is stored"


@dataclass(frozen=True, slots=True)
class Drawn:
    """A recording: how it was drawn, its file, the frames that must be read, and where the file ends or turns empty."""

    what: str
    path: Path
    readable: Sequence[Frame]
    end: int | None = None


def drawn(folder: Path, *, count: int, seed: int, most: int) -> Iterator[Drawn]:
    """Yield `count` recordings with bombs and tails of up to `most` bytes; each is removed before the next is drawn."""
    chance = random.Random(seed)
    for number in range(count):
        place = folder / str(number)
        place.mkdir()
        # In turn: each kind is there, however few are drawn.
        yield _KINDS[number % len(_KINDS)](place, chance, most)
        for path in sorted(place.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()


def _size(chance: random.Random, most: int) -> int:
    return int(most * 2 ** chance.uniform(-4, 0))


def _filling(chance: random.Random, size: int, head: bytes, empty: bytes) -> tuple[str, bytes]:
    """Return about `size` bytes without a message: zeros, one record, or empty records."""
    match chance.randrange(3):
        case 0:
            return f"{size} zeros", bytes(size)
        case 1:
            return f"a record of {size} bytes", head + bytes(size)
        case _:
            return f"{size} bytes of empty records", empty * (size // len(empty))


def _mcap_bomb(folder: Path, chance: random.Random, most: int) -> Drawn:
    """An MCAP file with chunks that unpack to a lot and hold no message."""
    whole = _mcap(folder, chance)
    size = _size(chance, most)
    private = chance.randrange(0x80, 0x100)
    what, content = _filling(chance, size, struct.pack("<BQ", private, size), struct.pack("<BQ", private, 0))
    kind = chance.choice([*_MCAP_PACKERS])
    word, pack = _MCAP_PACKERS[kind]
    data = pack(content)
    chunk = struct.pack("<QQQII", FRAMES[0].time, FRAMES[-1].time, chance.choice((0, len(content))), 0, len(word))
    chunk += word.encode() + struct.pack("<Q", len(data)) + data
    at = chance.choice([place for place, opcode in _mcap_records(whole) if opcode in (Opcode.CHUNK, Opcode.MESSAGE)])
    bombs = chance.randrange(1, 4)
    path = folder / "rig.mcap"
    path.write_bytes(whole[:at] + (struct.pack("<BQ", Opcode.CHUNK, len(chunk)) + chunk) * bombs + whole[at:])
    # Behind many records that hold nothing, the reading ends.
    readable = [] if "empty" in what else FRAMES
    return Drawn(f"{bombs} chunks at byte {at} of an MCAP file, {kind}: {what}", path, readable)


def _ros1_bomb(folder: Path, chance: random.Random, most: int) -> Drawn:
    """A ROS 1 bag whose last chunk goes on with much that is no message."""
    size = _size(chance, most)
    kind = chance.choice([*_ROS1_PACKERS])
    word, pack = _ROS1_PACKERS[kind]
    whole = write_ros1(folder / "whole", FRAMES, chunk=500).read_bytes()
    *_, at = _ros1_chunks(whole)
    (header,) = struct.unpack_from("<I", whole, at)
    begin = at + 8 + header
    end = begin + struct.unpack_from("<I", whole, begin - 4)[0]
    content = whole[begin:end] + bytes(size)
    data = pack(content)
    chunk = _ros1_header(op=b"\x05", compression=word.encode(), size=struct.pack("<I", len(content)))
    chunk += struct.pack("<I", len(data)) + data
    place = whole.index(b"index_pos=") + len(b"index_pos=")
    (index,) = struct.unpack_from("<Q", whole, place)
    moved = struct.pack("<Q", index + len(chunk) - (end - at))
    path = folder / "rig.bag"
    path.write_bytes(whole[:place] + moved + whole[place + 8 : at] + chunk + whole[end:])
    return Drawn(f"a chunk of a ROS 1 bag, {kind}, with {size} zeros behind its messages", path, [])


def _packed_file(folder: Path, chance: random.Random, most: int) -> Drawn:
    """A whole file that was packed, with a long tail of zeros."""
    make, name = chance.choice(((_mcap, "rig.mcap"), (_ros1, "rig.bag"), (_sqlite, "rig.db3")))
    size = _size(chance, most)
    kind = chance.choice([*_FILE_PACKERS])
    path = folder / f"{name}.{kind}"
    whole = make(folder, chance)
    path.write_bytes(_FILE_PACKERS[kind](whole + bytes(size)))
    return Drawn(f"{path.name} with {size} zeros behind it", path, FRAMES)


def _tail(folder: Path, chance: random.Random, most: int) -> Drawn:
    """A file that was cut off and continues with zeros, as after a loss of power, or with empty records."""
    loose = chance.random() < 0.5
    make, name = (_ros1, "rig.bag") if chance.random() < 0.3 else (_mcap, "rig.mcap")
    whole = _loose_mcap(folder) if make is _mcap and loose else make(folder, chance)
    cut = chance.randrange(len(whole) // 4, len(whole))
    size = _size(chance, most) // 4
    zeros = name == "rig.bag" or chance.random() < 0.7
    tail = bytes(size) if zeros else struct.pack("<BQ", chance.randrange(0x80, 0x100), 0) * (size // 9)
    path = folder / name
    path.write_bytes(whole[:cut] + tail)
    ends = {frame: whole.find(frame.payload) + len(frame.payload) for frame in FRAMES}
    readable = [frame for frame in FRAMES if ends[frame] <= cut] if make is _mcap and loose else []
    kind = "zeros" if zeros else "bytes of empty records"
    what = f"{name}, {'loose' if loose else 'in chunks'}, cut off at byte {cut}, {size} {kind} behind it"
    return Drawn(what, path, readable, cut if zeros else None)


def _sqlite_lie(kind: str, folder: Path, chance: random.Random, most: int) -> Drawn:
    """A sqlite3 file that computes what it should store."""
    path = folder / "rig.db3"
    path.write_bytes(_sqlite(folder, chance))
    table = chance.choice(("messages", "topics"))
    heavy = f"zeroblob({_size(chance, most)})"
    rows = chance.choice(("", " LIMIT 100000"))
    endless = f"WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n{rows})"
    columns = {
        "messages": f"1 AS topic_id, i AS timestamp, {heavy} AS data",
        "topics": f"i AS id, 'rig' || i AS name, hex({heavy}) AS type, 'cdr' AS serialization_format",
    }
    column = {"messages": "data", "topics": "type"}[table]
    others = {"messages": "id, topic_id, timestamp", "topics": "id, name, serialization_format"}[table]
    lies = {
        _VIEW: [f"DROP TABLE {table}", f"CREATE VIEW {table} AS {endless} SELECT {columns[table]} FROM n"],
        _GENERATED: [
            f"CREATE TABLE new({others}, {column} GENERATED ALWAYS AS ({heavy}))",
            f"INSERT INTO new SELECT {others} FROM {table}",
            f"DROP TABLE {table}",
            f"ALTER TABLE new RENAME TO {table}",
        ],
        _DEFAULT: [
            f"CREATE TABLE new({others})",
            f"INSERT INTO new SELECT {others} FROM {table}",
            f"ALTER TABLE new ADD COLUMN {column} DEFAULT X'{'00' * 20_000}'",
            f"DROP TABLE {table}",
            f"ALTER TABLE new RENAME TO {table}",
        ],
    }
    with closing(sqlite3.connect(path)) as database:
        for lie in lies[kind]:
            database.execute(lie)
        database.commit()
    return Drawn(f"{table} of a sqlite3 file: {kind}{rows}", path, [])


def _sqlite_bomb(folder: Path, chance: random.Random, most: int) -> Drawn:
    """A sqlite3 file of packed messages, some of which unpack to a lot and then turn out to be damaged."""
    (path,) = write_rosbag2(folder / "rig", FRAMES, mode=CompressionMode.MESSAGE).glob("*.db3")
    size = _size(chance, most)
    packed = chance.choice((zstandard.compress, zstd_piecewise))(bytes(size))[:-3]
    bad = chance.sample(range(3, len(FRAMES)), 3)
    with closing(sqlite3.connect(path)) as database:
        for row in bad:
            query = "UPDATE messages SET data = ? WHERE rowid = (SELECT rowid FROM messages LIMIT 1 OFFSET ?)"
            database.execute(query, (packed, row))
        database.commit()
    readable = [frame for row, frame in enumerate(FRAMES) if row not in bad]
    return Drawn(f"messages {bad} of a sqlite3 file that unpack to {size} bytes", path, readable)


def _mcap(folder: Path, chance: random.Random) -> bytes:
    options: dict[str, Any] = {"compression": chance.choice([*CompressionType]), "chunk_size": 500}
    return write_mcap(folder / "whole", FRAMES, **options).read_bytes()


def _loose_mcap(folder: Path) -> bytes:
    return write_mcap(folder / "whole", FRAMES, use_chunking=False).read_bytes()


def _ros1(folder: Path, chance: random.Random) -> bytes:
    compression = chance.choice((None, *Ros1Writer.CompressionFormat))
    return write_ros1(folder / "whole", FRAMES, compression=compression, chunk=500).read_bytes()


def _sqlite(folder: Path, _chance: random.Random) -> bytes:
    (file,) = write_rosbag2(folder / "rig", FRAMES).glob("*.db3")
    return file.read_bytes()


def _mcap_records(content: bytes) -> Iterator[tuple[int, int]]:
    """Where each record of a file begins up to its summary, and its opcode."""
    at = _MCAP_MAGIC
    while content[at] != Opcode.DATA_END:
        yield at, content[at]
        at += 9 + struct.unpack_from("<Q", content, at + 1)[0]


def _ros1_chunks(content: bytes) -> Iterator[int]:
    """Where each chunk of a bag begins."""
    at = _ROS1_MAGIC
    while at < len(content):
        (header,) = struct.unpack_from("<I", content, at)
        if b"op=\x05" in content[at + 4 : at + 4 + header]:
            yield at
        (size,) = struct.unpack_from("<I", content, at + 4 + header)
        at += 8 + header + size


def _ros1_header(**fields: bytes) -> bytes:
    packed = [name.encode() + b"=" + value for name, value in fields.items()]
    header = b"".join(struct.pack("<I", len(each)) + each for each in packed)
    return struct.pack("<I", len(header)) + header


_KINDS: Sequence[Callable[[Path, random.Random, int], Drawn]] = (
    _mcap_bomb,
    _ros1_bomb,
    _packed_file,
    _tail,
    _sqlite_bomb,
    *(partial(_sqlite_lie, kind) for kind in (_VIEW, _GENERATED, _DEFAULT)),
)
