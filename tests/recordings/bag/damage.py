"""Small recordings of every kind, and damage to them: flipped bits, missing ends, wrong lengths."""

import random
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from mcap.writer import CompressionType, IndexType
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionMode
from zstandard import compress

from tests.recordings.bag.making import BEST_EFFORT, rig, write_mcap, write_ros1, write_rosbag2

FRAMES = rig(12)
_SMALL_CHUNKS = {"chunk_size": 500}
NO_INDEX = {
    "index_types": IndexType.NONE,
    "repeat_channels": False,
    "repeat_schemas": False,
    "use_statistics": False,
    "use_summary_offsets": False,
}

Make = Callable[[Path], Path]


def mcap(**options) -> Make:
    return lambda folder: write_mcap(folder / "rig.mcap", FRAMES, qos=[BEST_EFFORT], **{**_SMALL_CHUNKS, **options})


def _mcap_of_compressed_messages(folder: Path) -> Path:
    frames = [each._replace(payload=compress(each.payload)) for each in FRAMES]
    return write_mcap(folder / "rig.mcap", frames, qos=[BEST_EFFORT], chunk_size=500)


def sqlite(**options) -> Make:
    def make(folder: Path) -> Path:
        (file,) = write_rosbag2(folder / "rig", FRAMES, qos=[BEST_EFFORT], **options).glob("*.db3")
        with sqlite3.connect(file) as database:
            # Eight times fewer bytes of nothing.
            database.execute("PRAGMA page_size=512")
            database.execute("VACUUM")
        database.close()
        return file

    return make


def ros1(compression=None) -> Make:
    return lambda folder: write_ros1(folder / "rig.bag", FRAMES, compression=compression, chunk=500)


KINDS: Mapping[str, Make] = {
    "sqlite3": sqlite(),
    "sqlite3, messages compressed": sqlite(mode=CompressionMode.MESSAGE),
    "MCAP": mcap(),
    "MCAP without checksums": mcap(enable_crcs=False),
    "MCAP, zstd": mcap(compression=CompressionType.ZSTD),
    "MCAP, lz4, without checksums": mcap(compression=CompressionType.LZ4, enable_crcs=False),
    "MCAP, zstd, without an index": mcap(compression=CompressionType.ZSTD, **NO_INDEX),
    "MCAP, messages compressed": _mcap_of_compressed_messages,
    "MCAP without chunks": mcap(use_chunking=False),
    "MCAP without chunks or an index": mcap(use_chunking=False, **NO_INDEX),
    "ROS 1": ros1(),
    "ROS 1, bz2": ros1(Ros1Writer.CompressionFormat.BZ2),
    "ROS 1, lz4": ros1(Ros1Writer.CompressionFormat.LZ4),
}


def damaged(content: bytes, *, places: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Yield a file's content with one bit flipped, and then cut off, `places` times each, with a description.

    No bits are flipped in empty areas, such as those of sqlite3's pages.
    """
    chance = random.Random(seed)
    written = [at for at in range(len(content)) if any(content[max(0, at - 8) : at + 1])]
    for at in _chosen(written, places, chance):
        bit = chance.randrange(8)
        yield f"bit {bit} of byte {at}", content[:at] + bytes([content[at] ^ 1 << bit]) + content[at + 1 :]
    for size in _chosen(range(len(content)), places, chance):
        yield f"cut off at byte {size}", content[:size]


def with_lying_lengths(content: bytes, *, places: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Yield a file's content with a far too large number written at a place: 4 or 8 bytes, in either byte order."""
    chance = random.Random(seed)
    lies = [(value, size) for size in (4, 8) for value in (1 << (8 * size - 2), (1 << 8 * size) - 1, 1 << 29)]
    for at in _chosen(range(8, len(content) - 8), places, chance):
        value, size = chance.choice(lies)
        lie = value.to_bytes(size, chance.choice(("little", "big")))
        yield f"{lie!r} at byte {at}", content[:at] + lie + content[at + size :]


def _chosen(places: Sequence[int], count: int, chance: random.Random) -> list[int]:
    """Return `count` of the places; if there are fewer, some of them twice."""
    whole, rest = divmod(count, len(places))
    return [*places] * whole + chance.sample(places, rest)
