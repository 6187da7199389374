"""Recordings with one wrong value each: what is right in them is read, and the rest is reported."""

import os
import sqlite3
import struct
from collections.abc import Callable, Sequence
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any

import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import ChunkIndex, Schema

from syncrelay.errors import BagError
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.effort import Effort
from syncrelay.recordings.bag.mcap_records import parsed
from syncrelay.recordings.bag.recording import LATEST
from syncrelay.recordings.bag.unpacking import unlz4, unzstd
from tests.recordings.bag.bombs import zstd_piecewise
from tests.recordings.bag.making import rig, write_mcap, write_rosbag2
from tests.recordings.bag.reading import read
from tests.ros.cdr_messages import VECTOR

_RIG = rig(6)


def _sqlite3(folder: Path, *lies: str) -> Path:
    """A recording whose tables take values of any type, after some statements of SQL."""
    (file,) = write_rosbag2(folder / "rig", _RIG).glob("*.db3")
    with closing(sqlite3.connect(file)) as database:
        for table in ("topics", "messages"):
            database.execute(f"CREATE TABLE free_{table} AS SELECT * FROM {table}")  # noqa: S608  of ours
            database.execute(f"DROP TABLE {table}")
            database.execute(f"ALTER TABLE free_{table} RENAME TO {table}")
        for lie in lies:
            database.execute(lie)
        database.commit()
    return file


def _first_message(column: str, value: object) -> str:
    return f"UPDATE messages SET {column} = {value} WHERE rowid = (SELECT rowid FROM messages LIMIT 1)"  # noqa: S608


def _topics(column: str, value: object, *, where: str = "name = '/camera'") -> str:
    return f"UPDATE topics SET {column} = {value} WHERE {where}"  # noqa: S608  of ours


_NO_CLOCK = "1 message left out: received before 1970 or after 2116"
_NOT_CLOSED = "was not closed, or is cut off; read to its end"
_STRAYS = "left out: channel not described in the file"
_ANY = ("NULL", "X'ff'", "7", "1.5", "hex(zeroblob(9))", f"'{'[' * 5000}'")
# How a table lies, the messages that are read all the same, and how each fault begins or ends.
_SQLITE_LIES = [
    *(
        (_first_message("timestamp", value), _RIG[1:], ["1 message left out: the time of receipt is not an integer"])
        for value in ("NULL", "'soon'", "1.5", "X'00'")
    ),
    *((_first_message("timestamp", value), _RIG[1:], [_NO_CLOCK]) for value in (-1, LATEST + 1, 2**63 - 1, -(2**63))),
    *(
        (_first_message("data", value), _RIG[1:], ["1 message left out: the payload is not a BLOB"])
        for value in ("NULL", "7", "'text'", "1.5", "CAST(data AS TEXT)")
    ),
    *(
        (_topics(column, value), _RIG[::2], ["a topic is left out", f"6 messages {_STRAYS}"])
        for column, values in {
            **dict.fromkeys(("name", "type", "serialization_format"), ("NULL", "X'ff00'")),
            "id": ("NULL", "'1) OR (1=1'", "X'01'", "1.5"),
        }.items()
        for value in values
    ),
    # What only describes a topic does not matter.
    *(
        (_topics(column, value, where="1"), _RIG, [])
        for column in ("offered_qos_profiles", "type_description_hash")
        for value in _ANY
    ),
]


@pytest.mark.parametrize(("lie", "expected", "faults"), _SQLITE_LIES)
def test_of_tables_that_lie_the_rest_is_read(lie, expected, faults, tmp_path):
    frames, found, _ = read(_sqlite3(tmp_path, lie))
    assert frames == expected
    assert len(found) == len(faults)
    assert all(fault.startswith(begin) for fault, begin in zip(found, faults, strict=True))


def _mcap(folder: Path, change: Callable[[bytearray], object] = bytes, **options: Any) -> Path:
    """An MCAP file of the rig, of which `change` makes another."""
    path = write_mcap(folder / "rig.mcap", _RIG, **options)
    content = bytearray(path.read_bytes())
    change(content)
    path.write_bytes(content)
    return path


def _with(old: bytes, new: bytes) -> Callable[[bytearray], None]:
    """What replaces the last such bytes of a file."""

    def change(content: bytearray) -> None:
        at = content.rindex(old)
        content[at : at + len(new)] = new

    return change


def _flip(content: bytearray, payload: bytes, place: int = 0) -> None:
    content[content.index(payload) + place % len(payload)] ^= 1


# The first message of the file, and of its channel.
_FIRST = struct.pack("<BQH", Opcode.MESSAGE, 22 + len(_RIG[0].payload), 1)


@pytest.mark.parametrize("time", [LATEST + 1, 2**64 - 1])
@pytest.mark.parametrize(
    "options", [{}, {"use_chunking": False}, {"chunk_size": 300}], ids=["chunk", "loose", "chunks"]
)
def test_an_mcap_message_of_a_time_that_no_clock_shows_is_left_out(time, options, tmp_path):
    path = write_mcap(tmp_path / "rig.mcap", [*_RIG, _RIG[-1]._replace(time=time)], **options)
    assert read(path) == (_RIG, [_NO_CLOCK], [])
    with closing(open_recording([str(path)])) as recording:
        assert recording.begin == _RIG[0].time
        assert recording.end <= LATEST


@pytest.mark.parametrize("opcode", [Opcode.SCHEMA, Opcode.CHANNEL])
def test_a_damaged_description_outside_of_chunks_is_said(opcode, tmp_path):
    def change(content: bytearray) -> None:
        content[content.index(b"/camera" if opcode == Opcode.CHANNEL else VECTOR.encode())] = 0xFF

    loose = {"use_chunking": False, "use_summary_offsets": False, "repeat_channels": False, "repeat_schemas": False}
    frames, faults, _ = read(_mcap(tmp_path, change, **loose))
    assert [frame.payload for frame in _RIG if frame.topic == "/lidar"] == [
        frame.payload for frame in frames if frame.topic == "/lidar"
    ]
    assert f"the {opcode.name.lower()} at byte" in faults[0]


@pytest.mark.parametrize("missing", [0, 1])
def test_no_length_in_a_record_points_past_its_end(missing):
    content = b"\1\0" + b"".join(struct.pack("<I", len(each)) + each for each in (b"a/A", b"ros2msg", b"byte b"))
    with nullcontext() if not missing else pytest.raises(EOFError):
        assert parsed(Schema, content[: len(content) - missing]).data == b"byte b"


def test_a_message_of_no_channel_is_counted(tmp_path):
    path = _mcap(tmp_path, _with(_FIRST, _FIRST[:-2] + b"\x4d\0"), enable_crcs=False)
    assert read(path)[1] == [f"1 message {_STRAYS}"]


@pytest.mark.parametrize(("number", "place"), [(0, 0), (5, 11), (11, -1)])
def test_a_chunk_of_a_wrong_checksum_is_left_out(number, place, tmp_path):
    """The flipped bit is in a payload, so that only the checksum can show it."""
    path = _mcap(tmp_path, lambda content: _flip(content, _RIG[number].payload, place), chunk_size=300)
    frames, (fault,), _ = read(path)
    assert set(frames) < set(_RIG)
    assert _RIG[number] not in frames
    assert fault.endswith("is damaged and left out: its checksum is wrong")


def test_of_many_damaged_places_the_first_are_named_and_the_others_counted(tmp_path):
    frames = rig(60)
    path = write_mcap(tmp_path / "rig.mcap", frames, chunk_size=1)
    content = bytearray(path.read_bytes())
    for frame in frames:
        _flip(content, frame.payload)
    path.write_bytes(content)
    found, faults, _ = read(path)
    assert found == []
    assert len(faults) == 101
    assert all(fault.startswith("the chunk at byte") for fault in faults[:-1])
    assert faults[-1] == "20 more places that cannot be read"


def test_an_mcap_file_that_ends_between_two_records_is_said(tmp_path):
    def change(content: bytearray) -> None:
        del content[content.rindex(struct.pack("<BQ", Opcode.MESSAGE, 22 + len(_RIG[-1].payload))) :]

    assert read(_mcap(tmp_path, change, use_chunking=False)) == (_RIG[:-1], [_NOT_CLOSED], [])


def _chunks(path: Path) -> Sequence[ChunkIndex]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        return summary.chunk_indexes


def test_messages_that_come_behind_later_ones_are_read_and_said(tmp_path):
    options: dict[str, Any] = {"chunk_size": 300, "enable_crcs": False}
    first = _chunks(_mcap(tmp_path, **options))[0]
    # The index says that the first chunk begins, and ends, an hour later.
    true = first.message_start_time, first.message_end_time
    later = [each + 3600 * 10**9 for each in true]
    path = _mcap(tmp_path, _with(struct.pack("<QQ", *true), struct.pack("<QQ", *later)), **options)
    frames, (fault,), _ = read(path)
    assert sorted(frames, key=_RIG.index) == _RIG
    assert fault.endswith("out of order: the index has other times")


def test_no_frame_unpacks_to_more_or_less_than_it_says():
    whole = zstandard.compress(bytes(70_000))
    lying = bytearray(whole)
    _with(struct.pack("<I", 70_000), struct.pack("<I", 2**32 - 1))(lying)
    for cut in (bytes(lying), whole[:-3], zstd_piecewise(bytes(70_000))[:-3], b"", whole[:4]):
        with pytest.raises((EOFError, ValueError, zstandard.ZstdError)):
            unzstd(cut, Effort())
    with pytest.raises((EOFError, RuntimeError)):
        unlz4(b"\x04\x22\x4d\x18", Effort())


def test_a_pipe_is_no_recording_and_nobody_waits_for_it(tmp_path):
    os.mkfifo(tmp_path / "rig.mcap")
    for named in (tmp_path, tmp_path / "rig.mcap"):
        with pytest.raises(BagError, match="is not a regular file"):
            open_recording([str(named)])
