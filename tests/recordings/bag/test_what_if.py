"""Faults laid over a recording: each does what it says, to the nanosecond, and the same again."""

from contextlib import closing
from itertools import chain

import pytest

from syncrelay.cdr import read_stamp
from syncrelay.errors import UsageError
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.what_if import Disturbed
from syncrelay.rig.what_if import parse_fault
from tests.recordings.bag.making import rig, write_mcap, write_ros1, write_rosbag2
from tests.ros.cdr_messages import stamp_of
from tests.ros.streams import MS

FRAMES = rig(40)
BEGAN = FRAMES[0].time


def _read(path, *faults, seed=0):
    """Topic, time of receipt and payload of every message, as they come."""
    with closing(open_recording([str(path)])) as recording:
        disturbed = Disturbed(recording, [parse_fault(fault) for fault in faults], seed=seed)
        batches = list(disturbed.batches(disturbed.channels))
        assert all(batches)
        return [(channel.topic, received, payload) for batch in batches for channel, received, payload in batch]


def _idle(path, *faults):
    """What is said of faults that changed nothing, once all that a group wants is read."""
    with closing(open_recording([str(path)])) as recording:
        disturbed = Disturbed(recording, [parse_fault(fault) for fault in faults], seed=0)
        wanted = [channel for channel in disturbed.channels if channel.topic == "/lidar"]
        assert sum(map(len, disturbed.batches(wanted)))
        return disturbed.idle()


def _as_recorded(change=lambda frame: frame):
    changed = [change(frame) for frame in FRAMES]
    return [(each.topic, each.time, each.payload) for each in changed if each is not None]


@pytest.fixture
def bag(tmp_path):
    return write_mcap(tmp_path / "rig.mcap", FRAMES)


def test_without_a_fault_that_holds_nothing_changes(bag):
    assert _read(bag) == _as_recorded()
    assert _read(bag, "late: /lidar 80ms from 60s", "dead: /camera from 60s", "drop: /lidar 0%") == _as_recorded()


def test_late_messages_come_later_and_behind_what_was_received_meanwhile(bag):
    late = _as_recorded(lambda each: each._replace(time=each.time + 150 * MS) if each.topic == "/lidar" else each)
    assert _read(bag, "late: /lidar 150ms") == sorted(late, key=lambda each: each[1])


def test_a_message_is_handed_on_as_soon_as_none_can_come_before_it(tmp_path, monkeypatch):
    expected = [(each.time + 150 * MS * (each.topic == "/lidar"), each.topic) for each in rig(5000)]
    came: list[tuple[int, str]] = []
    with closing(open_recording([str(write_mcap(tmp_path / "rig.mcap", rig(5000)))])) as recording:
        recorded = list(chain.from_iterable(recording.batches(recording.channels)))

        def batches(_):
            for at in range(0, len(recorded), 2500):
                yield recorded[at : at + 2500]
                assert came == sorted(each for each in expected if each[0] <= recorded[at + 2499][1])

        monkeypatch.setattr(recording, "batches", batches)
        disturbed = Disturbed(recording, [parse_fault("late: /lidar 150ms")], seed=0)
        for batch in disturbed.batches(disturbed.channels):
            came += [(received, channel.topic) for channel, received, _ in batch]
    assert came == sorted(expected)
    assert disturbed.end == recording.end + 150 * MS


def test_messages_of_a_topic_keep_their_order_when_its_lateness_ends(bag):
    lidar = [received for topic, received, _ in _read(bag, "late: /lidar 250ms until 1s") if topic == "/lidar"]
    assert lidar == sorted(lidar)
    # Of 0.9 s; those of 1.0 s and 1.1 s are held up behind it.
    assert lidar[9:13] == [BEGAN + ms * MS for ms in (1150, 1150, 1150, 1200)]


@pytest.mark.parametrize("write", [write_mcap, write_rosbag2])
def test_a_clock_that_is_off_changes_stamps_and_nothing_else(write, tmp_path):
    path = write(tmp_path / "rig", FRAMES)
    found = [(topic, received, read_stamp(payload)) for topic, received, payload in _read(path, "offset: /lidar -7ms")]
    shift = {"/lidar": -7 * MS, "/camera": 0}
    assert found == [(each.topic, each.time, stamp_of(each.payload) + shift[each.topic]) for each in FRAMES]


def test_a_clock_drifts_from_when_it_begins_and_keeps_what_it_gained(bag):
    found = [payload for topic, _, payload in _read(bag, "drift: /lidar 1000ppm from 1s until 2s") if topic == "/lidar"]
    recorded = [each for each in FRAMES if each.topic == "/lidar"]
    gained = [stamp_of(payload) - stamp_of(each.payload) for payload, each in zip(found, recorded, strict=True)]
    assert gained[:11] == [0] * 11
    assert gained[15] == MS // 2
    assert set(gained[20:]) == {MS}


def test_the_stamps_of_a_ros_1_bag_are_changed_too(tmp_path):
    path = write_ros1(tmp_path / "rig.bag", rig(3))
    before, after = _read(path), _read(path, "offset: /lidar 2s")
    for (topic, _, plain), (_, _, changed) in zip(before, after, strict=True):
        assert plain[:4] == changed[:4]
        assert plain[12:] == changed[12:]
        seconds = int.from_bytes(changed[4:8], "little") - int.from_bytes(plain[4:8], "little")
        assert seconds == (2 if topic == "/lidar" else 0)


def test_no_more_is_held_than_comes_in_a_minute(bag):
    with pytest.raises(UsageError, match="late by 61s in all, expected 60s at most"):
        _read(bag, "late: /lidar 60s", "late: /lidar 1s", "late: /camera 1s")


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("dead: /lidar from 10s", "the first message of /lidar came after 0 s, the last after 3.9 s"),
        ("late: /lidar 3ms from 10s until 11s", "the first message of /lidar came after 0 s, the last after 3.9 s"),
        ("drop: /lidar 0%", "all 40 messages of /lidar are as they were"),
        ("late: /lidar 0s", "all 40 messages of /lidar are as they were"),
        ("offset: /lidar 0s", "all 40 messages of /lidar are as they were"),
        ("dead: /camera", "no group received a message of /camera"),
    ],
)
def test_a_fault_that_changes_nothing_is_told_with_the_reason(bag, fault, why):
    assert _idle(bag, fault, "late: /lidar 3ms") == [f"`{fault}` changed nothing: {why}"]
