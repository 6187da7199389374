"""A replay feeds the engine as the relay would: by receive time, deadlines at their moment, misfits named."""

from contextlib import closing

import pytest

from syncrelay.config import load_text
from syncrelay.errors import BagError
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import bind
from syncrelay.recordings.bag.replay import received, replay
from syncrelay.sync import Drop, DropReason, Match
from tests.recordings.bag.making import (
    CUSTOM,
    CUSTOM_STORE,
    HEADERLESS,
    blip,
    rig,
    write_mcap,
    write_ros1,
    write_rosbag2,
)
from tests.ros.cdr_messages import STRING, TIME_REFERENCE, VECTOR, header, serialize, time, vector
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS, at, merged

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}


def _group(topics, **keys):
    return {"policy": "approximate_time", "slop": "5ms", "topics": topics, **keys}


def _replayed(path, group, **file_keys):
    """The sets and drops with the moments at which they left, and the result of the one group."""
    left = []
    with closing(open_recording([str(path)])) as recording:
        file = load_text(config({"front": group}, **file_keys))
        bindings = bind(file, recording)
        (result,) = replay(recording, bindings, listeners=[lambda _, outcome, now: left.append((outcome, now))])
    return left, result


def _sets(left):
    return [outcome.stamps for outcome, _ in left if isinstance(outcome, Match)]


def _drops(left):
    return [(each.message.stamp, each.reason) for each, _ in left if isinstance(each, Drop)]


@pytest.mark.parametrize("write", [write_mcap, write_rosbag2, write_ros1])
def test_sets_and_counts_are_those_of_the_engine(write, tmp_path):
    left, result = _replayed(write(tmp_path / "rig", rig()), _group(inputs(_PAIR)))
    assert _sets(left) == [(BEGIN + (100 * n + 3) * MS, BEGIN + 100 * n * MS) for n in range(39)]
    assert result.sets == 39
    assert [each.counts.fed for each in result.inputs] == [40, 40]
    assert _drops(left)[-1][1] is DropReason.SHUTDOWN


def test_a_set_that_waits_leaves_at_its_deadline_not_at_the_next_message(tmp_path):
    topics = [*inputs(_PAIR), {"topic": "/imu", "type": VECTOR, "required": False}]
    path = write_mcap(tmp_path / "rig.mcap", [*rig(3), *at("/imu", 5000)])
    left, _ = _replayed(path, _group(topics, max_wait="40ms"))
    waited = [
        now - max(received(m) for m in outcome.messages if m) for outcome, now in left if isinstance(outcome, Match)
    ]
    assert waited == [40 * MS] * 3
    assert all(outcome.messages[2] is None for outcome, _ in left if isinstance(outcome, Match))


def test_what_still_waits_at_the_end_leaves_when_its_time_has_come(tmp_path):
    left, _ = _replayed(write_mcap(tmp_path / "rig.mcap", rig(1)), _group(inputs(_PAIR), max_wait="1s"))
    ((a_set, now),) = left
    assert isinstance(a_set, Match)
    assert now == max(frame.time for frame in rig(1)) + 1000 * MS


def test_a_topic_that_the_recording_lacks_is_named_with_the_nearest(tmp_path):
    recording = open_recording([str(write_mcap(tmp_path / "rig.mcap", rig(2)))])
    topics = inputs({"/camra": VECTOR, "/xyz": VECTOR})
    (binding,) = bind(load_text(config({"front": _group(topics)})), recording)
    recording.close()
    assert binding.problems == (
        "front: /camra is not in the recording, did you mean `/camera`?",
        "front: /xyz is not in the recording, it has /lidar, /camera",
    )
    assert not binding.is_complete


def test_a_type_that_differs_from_the_files_is_named_and_not_fed(tmp_path):
    topics = inputs({"/camera": "sensor_msgs/msg/Image", "/lidar": VECTOR})
    recording = open_recording([str(write_mcap(tmp_path / "rig.mcap", rig(2)))])
    (binding,) = bind(load_text(config({"front": _group(topics)})), recording)
    (result,) = replay(recording, [binding])
    recording.close()
    assert binding.problems == (f"front: /camera is recorded as {VECTOR}, the file says sensor_msgs/msg/Image",)
    assert [each.counts.fed for each in result.inputs] == [0, 2]


def test_types_that_the_file_leaves_out_are_the_recordings(tmp_path):
    path = write_mcap(tmp_path / "rig.mcap", rig())
    left, result = _replayed(path, _group([{"topic": "/camera"}, {"topic": "/lidar"}]))
    with_types, _ = _replayed(path, _group(inputs(_PAIR)))
    assert _sets(left) == _sets(with_types)
    assert result.sets == 39


def test_two_recorded_types_of_a_topic_are_named_where_the_file_has_none(tmp_path):
    other = [Frame("/camera", TIME_REFERENCE, BEGIN, serialize(TIME_REFERENCE, header(BEGIN), time(0), ""))]
    paths = [write_mcap(tmp_path / "a.mcap", rig(2)), write_mcap(tmp_path / "b.mcap", other)]
    recording = open_recording([str(path) for path in paths])
    (binding,) = bind(load_text(config({"front": _group([{"topic": "/camera"}, {"topic": "/lidar"}])})), recording)
    recording.close()
    (problem,) = binding.problems
    assert problem.startswith("front: /camera is recorded as ")
    assert VECTOR in problem
    assert TIME_REFERENCE in problem
    assert not binding.is_complete


def test_names_are_resolved_as_the_node_would(tmp_path):
    frames = [frame._replace(topic=f"/robot{frame.topic}") for frame in rig(3)]
    topics = inputs({"camera": VECTOR, "/robot/lidar": VECTOR})
    left, _ = _replayed(write_mcap(tmp_path / "rig.mcap", frames), _group(topics), node={"namespace": "/robot"})
    assert len(_sets(left)) == 2


def _blips(stamps, **fields):
    return [Frame("/blip", CUSTOM, stamp, blip(stamp, **{"seen": stamp, **fields})) for stamp in stamps]


def test_a_type_that_nothing_here_knows_works_by_its_bytes(tmp_path):
    frames = merged(_blips(BEGIN + 100 * n * MS for n in range(5)), at("/lidar", *(100 * n for n in range(5))))
    path = write_mcap(tmp_path / "rig.mcap", frames, store=CUSTOM_STORE)
    left, _ = _replayed(path, _group(inputs({"/blip": CUSTOM, "/lidar": VECTOR})))
    assert len(_sets(left)) == 5


def test_a_stamp_in_a_field_of_a_recorded_type_is_found_by_its_definition(tmp_path):
    seen = BEGIN + 100 * MS
    frames = merged(_blips([BEGIN], seen=seen), at("/lidar", 100))
    path = write_mcap(tmp_path / "rig.mcap", frames, store=CUSTOM_STORE)
    topics = inputs({"/blip": CUSTOM, "/lidar": VECTOR})
    topics[0]["stamp"] = {"field": "seen"}
    left, _ = _replayed(path, _group(topics, max_wait="0ms"))
    assert _sets(left) == [(seen, seen)]
    topics[0]["stamp"] = {"field": "sen"}
    with pytest.raises(BagError, match="has no field sen"):
        _replayed(path, _group(topics))


def test_keys_are_read_from_ros2_and_ros1_payloads(tmp_path):
    references = [
        Frame(topic, TIME_REFERENCE, BEGIN + n, serialize(TIME_REFERENCE, header(BEGIN + n), time(n * MS), f"{n}"))
        for n in range(4)
        for topic in ("/a", "/b")
    ]
    topics = inputs({"/a": TIME_REFERENCE, "/b": TIME_REFERENCE})
    for key in ("source", "time_ref"):
        group = {"policy": "equal_key", "key": key, "topics": topics}
        for path in (write_mcap(tmp_path / f"{key}.mcap", references), write_ros1(tmp_path / f"{key}.bag", references)):
            assert len(_sets(_replayed(path, group)[0])) == 4


def test_headerless_messages_go_by_their_receive_time(tmp_path):
    frames = [Frame(topic, HEADERLESS, BEGIN + n * MS, serialize(STRING, "x")) for n in (1, 200) for topic in _PAIR]
    path = write_mcap(tmp_path / "rig.mcap", frames, store=CUSTOM_STORE)
    topics = inputs(dict.fromkeys(_PAIR, HEADERLESS))
    with pytest.raises(BagError, match="does not begin with a std_msgs/msg/Header"):
        _replayed(path, _group(topics))
    left, _ = _replayed(path, _group(inputs(dict.fromkeys(_PAIR, HEADERLESS), stamp="receive"), max_wait="0ms"))
    assert _sets(left) == [(frames[0].time,) * 2, (frames[2].time,) * 2]


def test_messages_without_a_readable_stamp_are_counted(tmp_path):
    frames = [Frame("/camera", VECTOR, BEGIN, vector(BEGIN)[:8]), Frame("/lidar", VECTOR, BEGIN, vector(0))]
    left, _ = _replayed(write_mcap(tmp_path / "rig.mcap", frames), _group(inputs(_PAIR)))
    assert _drops(left) == [(0, DropReason.MALFORMED), (0, DropReason.UNSTAMPED)]


def test_a_channel_that_is_not_of_ros_is_named(tmp_path):
    path = tmp_path / "rig.mcap"
    write_mcap(path, rig(1), enable_crcs=False)
    content = path.read_bytes().replace(b"\x03\0\0\0cdr", b"\x03\0\0\0xml")
    path.write_bytes(content)
    recording = open_recording([str(path)])
    (binding,) = bind(load_text(config({"front": _group(inputs(_PAIR))})), recording)
    recording.close()
    assert any("/camera is recorded as xml, expected cdr" in problem for problem in binding.problems)


@pytest.mark.parametrize("stamp", ["receive", {"field": "seen"}])
def test_only_what_a_header_can_hold_restamps_a_set(stamp, tmp_path):
    # Received after January 2038, which a header does not tell.
    late = 2**31 * 10**9 + 5
    frames = [Frame("/blip", CUSTOM, late, blip(BEGIN, seen=BEGIN)), *at("/lidar", 0)]
    path = write_mcap(tmp_path / "rig.mcap", frames, store=CUSTOM_STORE)
    topics = inputs({"/blip": CUSTOM, "/lidar": VECTOR})
    topics[0]["stamp"] = stamp
    left, _ = _replayed(path, _group(topics, restamp="latest", max_wait="0ms"))
    if stamp == "receive":
        assert (0, DropReason.MALFORMED) in _drops(left)
    else:
        assert _sets(left) == [(BEGIN, BEGIN)]
