"""A part of a recording by time is what reading all of it and leaving out the rest gives."""

import random
import shutil
import sqlite3
import struct
from contextlib import closing
from itertools import chain
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import IndexType

from syncrelay.errors import BagError
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.losses import STRAY, Losses
from syncrelay.recordings.bag.recording import AFTER_ALL, LATEST, Channel
from syncrelay.recordings.bag.segments import Segment, read_in_order
from syncrelay.recordings.bag.what_if import Disturbed
from syncrelay.rig.what_if import parse_fault
from tests.recordings.bag.making import write_mcap, write_ros1, write_rosbag2
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS, at

_COUNT = 200
_LENGTH = 100 * MS


def _frames() -> list[Frame]:
    """Two topics whose times are often equal, written a little out of order, so that chunks overlap."""
    chance = random.Random(5)
    frames = at("/a", *range(_COUNT)) + at("/b", *range(_COUNT))
    frames = [frame._replace(time=BEGIN + (frame.time - BEGIN) // 2 // MS * MS) for frame in frames]
    return sorted(frames, key=lambda frame: frame.time + chance.randrange(6 * MS))


def _mcap(folder: Path, **options) -> Path:
    return write_mcap(folder / "some.mcap", _frames(), chunk_size=1000, **options)


def _sqlite3_without_an_index_of_times(folder: Path) -> Path:
    (file,) = write_rosbag2(folder / "some", _frames()).glob("*.db3")
    with closing(sqlite3.connect(file)) as database:
        database.execute("DROP INDEX timestamp_idx")
        database.commit()
    return file


def _split(folder: Path) -> Path:
    """A folder of files that overlap in time, of different kinds."""
    frames, whole = _frames(), folder / "split"
    whole.mkdir()
    for number in range(4):
        part = frames[number * 100 : (number + 1) * 100]
        if number % 2:
            made = write_rosbag2(folder / f"part{number}", part)
            shutil.move(made / f"part{number}.db3", whole / f"some_{number}.db3")
        else:
            write_mcap(whole / f"some_{number}.mcap", part, chunk_size=1000)
    return whole


_KINDS = {
    "MCAP": _mcap,
    "MCAP without chunks": lambda folder: _mcap(folder, use_chunking=False),
    "MCAP without an index": lambda folder: _mcap(folder, index_types=IndexType.NONE),
    "sqlite3": lambda folder: write_rosbag2(folder / "some", _frames()),
    "sqlite3 without an index": _sqlite3_without_an_index_of_times,
    "ROS 1": lambda folder: write_ros1(folder / "some.bag", sorted(_frames(), key=lambda frame: frame.time)),
    "split": _split,
}


def _told(messages):
    return [(channel.topic, time, payload) for channel, time, payload in chain.from_iterable(messages)]


@pytest.fixture(scope="module", params=_KINDS)
def made(request, tmp_path_factory):
    return _KINDS[request.param](tmp_path_factory.mktemp("made"))


_TIMES = st.integers(-3 * MS, _LENGTH + 3 * MS).map(lambda time: BEGIN + time) | st.integers(-3, 103).map(
    lambda time: BEGIN + time * MS
)


@given(begin=_TIMES | st.just(0), end=_TIMES | st.just(AFTER_ALL), wanted=st.integers(1, 2))
def test_a_part_is_what_leaving_out_the_rest_gives(made, begin, end, wanted):
    with closing(open_recording([str(made)])) as recording:
        channels = [channel for channel in recording.channels if channel.topic in ("/a", "/b")[:wanted]]
        whole = _told(recording.batches(channels))
    with closing(open_recording([str(made)])) as recording:
        channels = [channel for channel in recording.channels if channel.topic in ("/a", "/b")[:wanted]]
        part = _told(recording.batches(channels, begin=begin, end=end))
        assert recording.faults == []
    assert len(whole) == wanted * _COUNT
    assert part == [each for each in whole if begin <= each[1] < end]


def test_only_what_may_be_of_the_time_is_read(tmp_path):
    with closing(open_recording([str(_mcap(tmp_path))])) as recording:
        batches = recording.batches(recording.channels, begin=BEGIN + 40 * MS, end=BEGIN + 45 * MS)
        sizes = [recording.position for _ in batches]
    assert 0 < sizes[-1] < recording.size / 4


@given(begin=_TIMES, end=_TIMES)
def test_a_part_of_what_would_have_been_recorded_has_the_faults_of_the_whole(tmp_path_factory, begin, end):
    path = _mcap(tmp_path_factory.mktemp("made"))
    faults = [parse_fault("drop: /a 20%"), parse_fault("late: /b 7ms")]
    parts = []
    for window in ({}, {"begin": begin, "end": end}):
        with closing(open_recording([str(path)])) as recording:
            parts.append(_told(Disturbed(recording, faults, seed=3).batches(recording.channels, **window)))
    assert parts[1] == [each for each in parts[0] if begin <= each[1] < end]


@pytest.mark.parametrize(("first", "last"), [(3600, 3600), (-3600, -3600), (0, 3600)])
def test_a_part_of_a_file_whose_index_tells_other_times_is_refused(first, last, tmp_path):
    """Whatever the index says, one of the parts that together are the whole finds out."""
    path = _mcap(tmp_path)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        chunk = summary.chunk_indexes[3]
    content = bytearray(path.read_bytes())
    old = struct.pack("<QQ", chunk.message_start_time, chunk.message_end_time)
    new = struct.pack("<QQ", chunk.message_start_time + first * 10**9, chunk.message_end_time + last * 10**9)
    place = content.rindex(old)
    content[place : place + len(new)] = new
    # A checksum of 0 is none.
    content[-12:-8] = bytes(4)
    path.write_bytes(content)
    middle = BEGIN + _LENGTH // 2
    refusals = []
    for begin, end in ((0, middle), (middle, AFTER_ALL)):
        found, refusal = _part(path, begin, end)
        assert found == sorted(found, key=lambda each: each[1])
        refusals += refusal
    expected = (
        f"{path}: the messages at byte {chunk.chunk_start_offset} are of other times than the index says,"
        " so that no part of the recording can be told by time: read it as a whole"
    )
    # An index that says more than is there leads to all that is there.
    assert refusals == ([] if (first, last) == (0, 3600) else [expected])


def _part(path, begin, end):
    with closing(open_recording([str(path)])) as recording:
        try:
            return _told(recording.batches(recording.channels, begin=begin, end=end)), []
        except BagError as error:
            return [], [str(error)]


def _segments_read(segments, messages, **window):
    losses = Losses("made")
    found = read_in_order(segments, lambda segment: list(messages[segment.offset]), losses, **window)
    return [time for _, part in found for _, time, _ in part], losses.sentences


def test_a_segment_of_no_time_is_read_for_the_last_part_so_that_its_lie_is_found():
    channel = Channel(1, "/a", "", "")
    segments = [Segment(0, 1, 0, 9), Segment(1, 1, LATEST + 5, LATEST + 6), Segment(2, 1, 20, 8)]
    messages = {0: [(channel, 3, b""), STRAY], 1: [(channel, 5, b"")], 2: [(channel, 8, b"")]}
    assert _segments_read(segments[:1], messages, end=4)[0] == [3]
    with pytest.raises(BagError, match="made: the messages at byte 1 are of other times"):
        _segments_read(segments[:2], messages, begin=5)
    for window in ({"end": 9}, {"begin": 19}):
        with pytest.raises(BagError, match="made: the messages at byte 2 are of other times"):
            _segments_read(segments[::2], messages, **window)
