"""Every kind of recording gives the same messages; of a damaged one, what can be read is read and the rest said."""

import bz2
import gzip
import json
import os
import random
import re
import shutil
import sqlite3
import struct
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import IndexType, Writer
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from syncrelay.config.profile import Profile
from syncrelay.config.wording import all_of, counted
from syncrelay.errors import BagError
from syncrelay.recordings.bag import open_recording, recording, segments
from syncrelay.recordings.bag.metadata import parse_metadata
from syncrelay.recordings.bag.recording import Definition, Encoding
from tests.recordings.bag.damage import FRAMES, KINDS, mcap, ros1
from tests.recordings.bag.making import BEST_EFFORT, ROS1_STORE, as_ros1, rig, write_mcap, write_ros1, write_rosbag2
from tests.recordings.bag.reading import full_disk, read
from tests.ros.cdr_messages import IMAGE, STORE, VECTOR, header, serialize
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS


def _rosbag2(**options):
    return lambda folder: write_rosbag2(folder / "rig", FRAMES, qos=[BEST_EFFORT], **options)


def _packed(make, suffix, pack):
    def packed(folder: Path) -> Path:
        plain = make(folder)
        path = plain.with_name(plain.name + suffix)
        path.write_bytes(pack(plain.read_bytes()))
        plain.unlink()
        return path

    return packed


def _split(make_one, count=3):
    """A folder of files that each hold a part of the rig."""

    def split(folder: Path) -> Path:
        (folder / "split").mkdir()
        size = -(-len(FRAMES) // count)
        for number in range(count):
            make_one(folder / "split", number, FRAMES[number * size : (number + 1) * size])
        return folder / "split"

    return split


def _split_sqlite(folder: Path, number: int, frames: list[Frame]) -> None:
    made = write_rosbag2(folder / f"part{number}", frames, qos=[BEST_EFFORT])
    shutil.move(made / f"part{number}.db3", folder / f"rig_{number}.db3")
    shutil.rmtree(made)


def _split_mcap(folder: Path, number: int, frames: list[Frame]) -> None:
    write_mcap(folder / f"rig_{number}.mcap", frames, qos=[BEST_EFFORT])


_ALL_KINDS = {
    **KINDS,
    "sqlite3, file compressed": _rosbag2(mode=CompressionMode.FILE),
    "sqlite3, split": _split(_split_sqlite),
    "rosbag2 MCAP": _rosbag2(plugin=StoragePlugin.MCAP),
    "rosbag2 MCAP, messages compressed": _rosbag2(plugin=StoragePlugin.MCAP, mode=CompressionMode.MESSAGE),
    "rosbag2 MCAP, chunks compressed": _rosbag2(plugin=StoragePlugin.MCAP, mode=CompressionMode.STORAGE),
    "rosbag2 MCAP, file compressed": _rosbag2(plugin=StoragePlugin.MCAP, mode=CompressionMode.FILE),
    "MCAP without an index, but a summary": mcap(index_types=IndexType.NONE),
    "MCAP with an index of chunks alone": mcap(index_types=IndexType.CHUNK),
    "MCAP with an index that describes no channel": mcap(repeat_channels=False, repeat_schemas=False),
    "MCAP of another profile": mcap(profile=""),
    "MCAP, split": _split(_split_mcap),
    "MCAP, gzip": _packed(mcap(), ".gz", gzip.compress),
    "MCAP, zstd as a whole": _packed(mcap(), ".zstd", zstandard.compress),
    "ROS 1, .bag.bz2": _packed(ros1(), ".bz2", bz2.compress),
    "ROS 1, split": _split(lambda folder, number, frames: write_ros1(folder / f"rig_{number}.bag", frames)),
}


_ROS2 = Definition("ros2msg", STORE.generate_msgdef(VECTOR, ros_version=2)[0])
_ROS1 = Definition("ros1msg", ROS1_STORE.generate_msgdef(VECTOR, ros_version=1)[0])


_EVER = 2**63 - 1


def _described(kind: str) -> set[tuple[object, ...]]:
    """What the maker of a kind of recording knows of its topics."""
    if kind.startswith("ROS 1"):
        latched = {"/camera": (), "/lidar": (Profile(durability="transient_local"),)}
        return {(topic, VECTOR, Encoding.ROS1, _ROS1, qos, "") for topic, qos in latched.items()}
    qos = Profile("keep_last", 5, "best_effort", "volatile", _EVER, _EVER, "automatic", _EVER)
    # rosbags writes no hashes into MCAP files.
    hashed = "" if kind.startswith("rosbag2 MCAP") else STORE.hash_rihs01(VECTOR)
    return {(topic, VECTOR, Encoding.CDR, _ROS2, (qos,), hashed) for topic in ("/camera", "/lidar")}


@pytest.mark.parametrize("kind", _ALL_KINDS)
def test_every_kind_of_recording_gives_what_was_recorded_as_it_was_received(kind, tmp_path, monkeypatch):
    # Several batches, and of several parts.
    monkeypatch.setattr(recording, "_MESSAGES", 5)
    monkeypatch.setattr(segments, "PIECE", 500)
    path = _ALL_KINDS[kind](tmp_path)
    for topics in (None, {"/camera"}, set()):
        frames, faults, _ = read(path, topics=topics)
        expected = [frame for frame in FRAMES if topics is None or frame.topic in topics]
        if kind.startswith("ROS 1"):
            # ROS 1's headers begin with `seq`; each file of a split bag counts anew.
            expected = [frame._replace(payload=as_ros1(frame, 0)[4:]) for frame in expected]
            frames = [frame._replace(payload=frame.payload[4:]) for frame in frames]
        assert (frames, faults) == (expected, [])
    with closing(open_recording([str(path)])) as opened:
        assert (opened.begin, opened.end) == (FRAMES[0].time, FRAMES[-1].time)
        assert len(opened.channels) == 2 * (3 if "split" in kind else 1)
        assert {
            (each.topic, each.type, each.encoding, each.definition, each.qos, each.type_hash)
            for each in opened.channels
        } == _described(kind)


def test_several_recordings_are_read_as_one(tmp_path):
    camera = write_mcap(tmp_path / "camera.mcap", [frame for frame in FRAMES if frame.topic == "/camera"])
    lidar = write_rosbag2(tmp_path / "lidar", [frame for frame in FRAMES if frame.topic == "/lidar"])
    assert read(camera, lidar) == (FRAMES, [], [])


def test_a_folder_may_be_named_by_its_metadata(tmp_path):
    assert read(_rosbag2()(tmp_path) / "metadata.yaml") == (FRAMES, [], [])


_COUNTS = st.sampled_from([0, 5, None, -1, "5", True])
_LISTED = st.dictionaries(st.sampled_from([f"rig_{n}.mcap" for n in range(9)]), _COUNTS, max_size=9)


@given(listed=_LISTED, gone=st.sets(st.integers(0, 8)), packed=st.sets(st.integers(0, 8)), others=st.integers(0, 2))
def test_files_that_the_metadata_names_and_that_are_gone_are_said(listed, gone, packed, others):
    names, missing = [*listed], [name for name in listed if int(name[4]) in gone]
    there = [f"{name}.zstd" if int(name[4]) in packed else name for name in names if name not in missing]
    files = [{"path": f"day/{name}", "message_count": count} for name, count in listed.items()]
    about = {
        "relative_file_paths": [*(f"day/{name}" for name in names), 7],
        "files": [7, {"path": 7, "message_count": 5}, {"path": "other.mcap", "message_count": 5}, *files],
        "topics_with_message_count": [
            *(7, {}, {"topic_metadata": 7, "message_count": 5}, {"topic_metadata": {"name": 7}, "message_count": 5}),
            *({"topic_metadata": {"name": name}, "message_count": count} for name, count in listed.items()),
        ],
    }
    metadata = parse_metadata(json.dumps({"rosbag2_bagfile_information": about}).encode())
    assert metadata is not None
    known = {name: count if count in (0, 5) and count is not True else None for name, count in listed.items()}
    assert metadata.files == known
    assert metadata.topics == {f"/{name}": count or 0 for name, count in known.items()}
    said = metadata.missing([*there, *(f"drive_{n}.mcap" for n in range(others))])
    # As many other files may be the same by other names.
    assert bool(said) == (others < len(missing))
    if said:
        counts = [known[name] for name in missing]
        held = "" if None in counts else f", with {counted(sum(filter(None, counts)), 'message')}"
        are = "is" if len(missing) == 1 else "are"
        shown = all_of([*missing[:5], *([f"{len(missing) - 5} more"] if len(missing) > 5 else [])])
        of = f"{len(missing)} of the {len(names)} files that metadata.yaml names"
        assert said == f"{of} {are} missing{held}: {shown}"


def _with_metadata(folder: Path, about: object) -> Path:
    (folder / "metadata.yaml").write_text(json.dumps(about))
    return folder


def test_messages_that_the_metadata_counts_and_that_are_missing_are_said(tmp_path):
    counted = [{"topic_metadata": {"name": "/camera"}, "message_count": 13}]
    about = {"topics_with_message_count": [*counted, {"topic_metadata": {"name": "/lidar"}, "message_count": 12}]}
    folder = _with_metadata(_ALL_KINDS["MCAP, split"](tmp_path), {"rosbag2_bagfile_information": about})
    said = "metadata.yaml counts {} of the topics that were read, found {}"
    assert read(folder).faults == [f"1 message missing: {said.format(25, 24)}"]
    assert read(folder, topics={"/camera"}).faults == [f"1 message missing: {said.format(13, 12)}"]
    assert read(folder, topics={"/lidar"}).faults == []
    with closing(open_recording([str(folder)])) as opened:
        # One of the channels of its topic, of which nothing is counted.
        assert len(list(opened.batches(opened.channels[:1]))) == 1
        assert opened.faults == []


@pytest.mark.parametrize("about", [[1], "text", {}, {"rosbag2_bagfile_information": [1]}], ids=str)
def test_a_metadata_yaml_that_is_not_of_rosbag2_does_not_matter(about, tmp_path):
    assert read(_with_metadata(_ALL_KINDS["MCAP, split"](tmp_path), about)) == (FRAMES, [], [])


@pytest.mark.parametrize(("size", "why"), [(4_000_000, "is damaged"), (4_000_001, "is larger than 4 MB")])
def test_a_metadata_yaml_that_cannot_be_read_is_said(size, why, tmp_path):
    folder = _ALL_KINDS["MCAP, split"](tmp_path)
    (folder / "metadata.yaml").write_text("#" * size)
    assert read(folder) == (FRAMES, [f"metadata.yaml {why}: missing files would not be noticed"], [])


@pytest.mark.parametrize("change", ["never closed", "cut off"])
def test_a_ros1_bag_without_an_index_is_refused_with_the_command_that_makes_one(change, tmp_path):
    path = ros1()(tmp_path)
    content = path.read_bytes()
    # What the recorder writes last: where the index is.
    at = content.index(b"index_pos=") + len(b"index_pos=")
    path.write_bytes(content[:-200] if change == "cut off" else content[:at] + bytes(8) + content[at + 8 :])
    with pytest.raises(BagError, match=r"rig\.bag: its index cannot be read: .* run `rosbag reindex .*rig\.bag`"):
        read(path)


@pytest.mark.parametrize(
    ("field", "value", "why"),
    [
        (b"index_pos=", struct.pack("<Q", 1 << 40), "Header could not be read from file"),
        (b"index_pos=", struct.pack("<Q", 13), "Record of type 'BAGHEADER' is unexpected"),
        (b"message_definition=", b"\xff", "Could not read string field 'message_definition'"),
    ],
)
def test_why_the_index_of_a_ros1_bag_cannot_be_read_is_said_in_words(field, value, why, tmp_path):
    path = ros1()(tmp_path)
    content = path.read_bytes()
    # The last one is in the index.
    at = content.rindex(field) + len(field)
    path.write_bytes(content[:at] + value + content[at + len(value) :])
    with pytest.raises(BagError, match=rf"its index cannot be read: {why}\. A bag that was not closed"):
        read(path)


def test_of_what_rosbags_has_no_words_for_no_exception_is_shown(tmp_path):
    path = ros1()(tmp_path)
    content = path.read_bytes()
    # Of a message's header: the connection that it belongs to, which the index knows under another number.
    at = next(re.finditer(rb"op=\x02.{4}conn=", content, re.DOTALL)).end()
    path.write_bytes(content[:at] + b"\7" + content[at + 1 :])
    _, (fault,), _ = read(path)
    assert fault == "damaged; read as far as possible: the records do not fit together"


def test_a_compressed_file_that_is_cut_off_is_read_as_far_as_it_goes(tmp_path):
    path = _packed(ros1(), ".bz2", lambda content: bz2.compress(content)[:-200])(tmp_path)
    with pytest.raises(BagError, match=r"rig\.bag\.bz2: cut off or damaged"):
        read(path)
    # Several blocks of bz2, each of 900 kB.
    chance = random.Random(1)
    many = [frame._replace(payload=frame.payload + chance.randbytes(20_000)) for frame in rig(100)]
    packed = bz2.compress(write_mcap(tmp_path / "many.mcap", many, chunk_size=100_000).read_bytes())
    (tmp_path / "many.mcap.bz2").write_bytes(packed[: len(packed) * 2 // 3])
    frames, faults, _ = read(tmp_path / "many.mcap.bz2")
    assert 0 < len(frames) < len(many)
    assert any("cut off" in fault for fault in faults)


@pytest.mark.parametrize("killed_with", [100, 1_000_000], ids=["a little", "more than is in the file"])
def test_what_a_killed_recorder_left_in_the_write_ahead_log_is_read(killed_with, tmp_path):
    made = _rosbag2()(tmp_path) / "rig.db3"
    killed = tmp_path / "killed.db3"
    database = sqlite3.connect(made)
    database.execute("PRAGMA journal_mode=WAL")
    database.execute("PRAGMA wal_autocheckpoint=0")
    topic, last = database.execute("SELECT topic_id, max(timestamp) FROM messages").fetchone()
    row = (topic, last + MS, bytes(killed_with))
    database.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", row)
    database.commit()
    shutil.copy(made, killed)
    shutil.copy(f"{made}-wal", f"{killed}-wal")
    database.close()
    frames, faults, _ = read(killed)
    assert (frames[:-1], len(frames), faults) == (FRAMES, len(FRAMES) + 1, [])


def _encrypted() -> bytes:
    fields = (
        b"op=\3",
        b"index_pos=" + bytes(8),
        b"conn_count=" + bytes(4),
        b"chunk_count=" + bytes(4),
        b"encryptor=aes",
    )
    header = b"".join(struct.pack("<I", len(each)) + each for each in fields)
    return b"#ROSBAG V2.0\n" + struct.pack("<I", len(header)) + header + bytes(4)


@pytest.mark.parametrize("is_chunked", [True, False])
def test_an_mcap_file_without_a_message_is_whole_and_has_its_topics(is_chunked, tmp_path):
    with (tmp_path / "rig.mcap").open("wb") as file:
        writer = Writer(file, use_chunking=is_chunked)
        writer.start("ros2")
        schema = writer.register_schema(VECTOR, "ros2msg", b"")
        writer.register_channel("/camera", "cdr", schema)
        writer.finish()
    with closing(open_recording([str(tmp_path / "rig.mcap")])) as recording:
        assert list(recording.batches(recording.channels)) == []
        assert ([each.topic for each in recording.channels], recording.faults) == (["/camera"], [])


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("notes.txt", b"hello", "is not a recording, expected MCAP, a sqlite3 file of rosbag2 or a ROS 1 bag"),
        ("empty.mcap", b"", "is empty"),
        ("old.bag", b"#ROSBAG V1.2\n", "is a bag of a format other than 2.0"),
        ("torn.mcap", b"\x89MCAP0\r\n\x01", "no message can be read: .*cut off or damaged at byte 8 of 9"),
        ("hushed.bag", _encrypted(), "is encrypted, which is not supported"),
        ("torn.bag", b"#ROSBAG V2.0\n\x45\0\0\0", "its index cannot be read: .*rosbag reindex"),
        ("other.db3", b"SQLite format 3\0" + bytes(100), "cannot be read as a rosbag2 recording"),
    ],
)
def test_what_is_no_recording_is_said(name, content, said, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(BagError, match=said):
        open_recording([str(tmp_path / name)])


def test_a_path_that_the_system_refuses_is_said(tmp_path):
    for path in ("x" * 300, str(tmp_path / ("x" * 300) / "metadata.yaml")):
        with pytest.raises(BagError, match="cannot be read: File name too long"):
            open_recording([path])


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
@pytest.mark.parametrize("mode", [0o000, 0o400])
def test_a_folder_that_cannot_be_read_is_said(mode, tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir()
    (folder / "rig.mcap").touch()
    folder.chmod(mode)
    with pytest.raises(BagError, match="cannot be read: Permission denied"):
        open_recording([str(folder)])


def test_no_folder_to_decompress_in_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    path = tmp_path / "rig.mcap.gz"
    path.write_bytes(gzip.compress(b"\x89MCAP0\r\n"))
    with pytest.raises(BagError, match=r"rig\.mcap\.gz: no temporary folder to decompress it in, set TMPDIR to one"):
        open_recording([str(path)])


def test_a_name_that_is_not_there_gets_the_nearest(tmp_path):
    (tmp_path / "drive.mcap").touch()
    with pytest.raises(BagError, match=r"drve\.mcap: no such file or folder, did you mean `drive\.mcap`"):
        open_recording([str(tmp_path / "drve.mcap")])
    with pytest.raises(BagError, match=r"drve\.mcap: no such file or folder$"):
        open_recording([str(tmp_path / "drive.mcap"), str(tmp_path / "drve.mcap")])
    (tmp_path / "sub").mkdir()
    with pytest.raises(BagError, match="holds no recording"):
        open_recording([str(tmp_path / "sub")])


_PEAK = """
import resource, sys
from syncrelay.recordings.bag import open_recording, recording, segments
from syncrelay.recordings.bag.metadata import parse_metadata
for name in sys.argv[1:]:
    recording = open_recording([name])
    for _ in recording.batches(recording.channels):
        pass
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)
"""


@pytest.mark.parametrize("write", [write_mcap, write_rosbag2, write_ros1], ids=["mcap", "sqlite3", "ros1"])
@pytest.mark.process
def test_memory_does_not_grow_with_the_recording(write, tmp_path):
    # Large enough to see, and of many chunks: 4 MB and 60 MB.
    picture = np.zeros(1_000_000, dtype=np.uint8)
    payload = serialize(IMAGE, header(BEGIN), 1000, 1000, "mono8", 0, 1000, picture)
    frames = [Frame("/camera", IMAGE, BEGIN + n * MS, payload) for n in range(60)]
    paths = [write(tmp_path / "small", frames[:4]), write(tmp_path / "large", frames)]
    done = subprocess.run([sys.executable, "-c", _PEAK, *paths], capture_output=True, text=True, check=True)
    small, large = map(int, done.stdout.split())
    assert large - small < 20


@pytest.mark.parametrize("size", [2000, 50_000], ids=["noticed as it is closed", "noticed as it is written"])
def test_where_there_is_no_space_to_decompress_a_file_that_is_said(size, tmp_path):
    (tmp_path / "rig.bag.gz").write_bytes(gzip.compress(bytes(size)))
    with full_disk(), pytest.raises(BagError, match=r"rig\.bag\.gz: no space in .* to decompress it, set TMPDIR"):
        open_recording([str(tmp_path / "rig.bag.gz")])
