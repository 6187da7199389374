"""A replay feeds the engine as the relay would: by receive time, deadlines at their moment, misfits named."""

import pytest

from syncrelay.errors import BagError
from syncrelay.recordings.bag.replay import replay
from syncrelay.sync import Drop, DropReason, Match
from tests.recordings.bag.making import CUSTOM, CUSTOM_STORE, blip, rig, write_mcap, write_ros1
from tests.recordings.bag.reading import bound, one_by_one
from tests.ros.cdr_messages import TIME_REFERENCE, VECTOR, header, serialize, time
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS, at, merged

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}


def _group(topics, **keys):
    return {"policy": "approximate_time", "slop": "5ms", "topics": topics, **keys}


def _replayed(path, group, **file_keys):
    """The sets and drops with the moments at which they left, and the result of the one group."""
    left = []
    with bound(path, text=config({"front": group}, **file_keys)) as (recording, bindings):
        listener = one_by_one(lambda _, outcome, now: left.append((outcome, now)))
        (result,) = replay(recording, bindings, listeners=[listener])
    return left, result


def _sets(left):
    return [outcome.stamps for outcome, _ in left if isinstance(outcome, Match)]


def _drops(left):
    return [(each.message.stamp, each.reason) for each, _ in left if isinstance(each, Drop)]


_WHICH = "and the file has no type for it: write the one that is meant"
_OTHER = Frame("/camera", TIME_REFERENCE, BEGIN, serialize(TIME_REFERENCE, header(BEGIN), time(0), ""))


@pytest.mark.parametrize(
    ("frames", "topics", "problems"),
    [
        (
            rig(2),
            inputs({"/camra": VECTOR, "/xyz": VECTOR}),
            [
                "/camra is not in the recording, did you mean `/camera`?",
                "/xyz is not in the recording, it has /lidar, /camera",
            ],
        ),
        (
            rig(2),
            inputs({"/camera": "sensor_msgs/msg/Image", "/lidar": VECTOR}),
            [f"/camera is recorded as {VECTOR}, the file says sensor_msgs/msg/Image"],
        ),
        (
            [_OTHER, *rig(2)],
            [{"topic": "/camera"}, {"topic": "/lidar"}],
            [f"/camera is recorded as {TIME_REFERENCE} and {VECTOR}, {_WHICH}"],
        ),
    ],
    ids=["no such topic", "another type", "two types and none in the file"],
)
def test_what_does_not_fit_is_named_and_not_fed(frames, topics, problems, tmp_path):
    kinds = [[each for each in frames if each is _OTHER], [each for each in frames if each is not _OTHER]]
    paths = [write_mcap(tmp_path / f"{number}.mcap", each) for number, each in enumerate(kinds) if each]
    with bound(*paths, text=config({"front": _group(topics)})) as (recording, (binding,)):
        (result,) = replay(recording, [binding])
    assert binding.problems == tuple(f"front: {problem}" for problem in problems)
    assert not binding.is_complete
    assert result.inputs[0].counts.fed == 0


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


def test_a_channel_that_is_not_of_ros_is_named(tmp_path):
    path = tmp_path / "rig.mcap"
    write_mcap(path, rig(1), enable_crcs=False)
    content = path.read_bytes().replace(b"\x03\0\0\0cdr", b"\x03\0\0\0xml")
    path.write_bytes(content)
    with bound(path, text=config({"front": _group(inputs(_PAIR))})) as (_, (binding,)):
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


def test_a_topic_that_is_not_in_the_recording_is_no_loss_to_a_quorum_of_the_others(tmp_path):
    group = _group(inputs({"/radar": VECTOR, **_PAIR}), quorum=2, max_wait="50ms")
    recording = write_mcap(tmp_path / "drive.mcap", rig(10))
    left, result = _replayed(recording, group)
    assert [stamps[0] for stamps in _sets(left)] == [None] * 10
    assert result.sets == 10
    for quorum, is_complete in ((2, True), (None, False)):
        keys = {} if quorum is None else {"quorum": quorum, "max_wait": "50ms"}
        text = config({"front": _group(inputs({"/radar": VECTOR, **_PAIR}), **keys)})
        with bound(recording, text=text) as (_, (binding,)):
            assert binding.is_complete is is_complete
