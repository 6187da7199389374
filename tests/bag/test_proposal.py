"""A file proposed for a recording is in order, and gives sets of it."""

from contextlib import closing
from pathlib import Path

import pytest

from syncrelay.bag import open_recording
from syncrelay.bag.analysis import propose
from syncrelay.bag.replay import replay
from syncrelay.bag.wiring import wire
from syncrelay.config import Severity, load_text
from syncrelay.errors import NothingToMatchError
from tests.bag.making import BEST_EFFORT, write_mcap, write_rosbag2
from tests.ros import recordings
from tests.ros.cdr_messages import STRING, VECTOR, header, serialize, vector
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS, at, jittery, merged

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


def _proposed(bag: Path) -> tuple[str, dict[str, int]]:
    """The text for a recording, and the sets of each group when it is replayed."""
    with closing(open_recording([str(bag)])) as recording:
        text = propose(recording)
    with closing(open_recording([str(bag)])) as recording:
        results = replay(recording, wire(load_text(text, package_missing=Severity.NOTE), recording))
    return text, {result.name: result.sets for result in results}


def _stereo_and_lidar() -> list[Frame]:
    camera = jittery("/left", period_ms=50, jitter_ms=2, count=100, seed=1)
    other = [frame._replace(topic="/right") for frame in camera]
    return merged(camera, other, jittery("/lidar", period_ms=100, jitter_ms=3, count=50, seed=2))


def test_topics_of_one_epoch_become_a_group_and_one_of_each_another(tmp_path):
    text, sets = _proposed(write_mcap(tmp_path / "rig.mcap", _stereo_and_lidar()))
    groups = {group.name: group for group in load_text(text).groups}
    assert {name: {topic.topic for topic in group.topics} for name, group in groups.items()} == {
        "epoch_1": {"/left", "/right"},
        "fused": {"/lidar", "/left"},
    }
    assert groups["epoch_1"].keys.policy == "exact_time"
    assert sets["epoch_1"] == 100
    assert sets["fused"] >= 49


def test_what_was_measured_stands_in_comments(tmp_path):
    bag = write_rosbag2(tmp_path / "rig", _stereo_and_lidar(), qos=[BEST_EFFORT])
    lines = _proposed(bag)[0].splitlines()
    assert "  epoch_1:  # 100 of 100 possible sets of the recording" in lines
    (lidar,) = (line for line in lines if "/lidar" in line)
    assert lidar.endswith("Hz, best_effort")


def test_a_constant_distance_is_told(tmp_path):
    frames = merged(at("/lidar", *range(0, 5000, 100)), at("/camera", *range(12, 5000, 100)))
    assert "if one trigger starts both, write `offset: " in _proposed(write_mcap(tmp_path / "rig.mcap", frames))[0]


def test_topics_without_stamps_or_with_few_messages_are_left_out(tmp_path):
    text = [Frame("/text", STRING, BEGIN + n * MS, serialize(STRING, "x")) for n in range(50)]
    unset = [Frame("/unset", VECTOR, BEGIN + n * 100 * MS, vector(0)) for n in range(50)]
    frames = merged(text, unset, at("/rare", 1, 2, 3), _stereo_and_lidar())
    proposed, _ = _proposed(write_mcap(tmp_path / "rig.mcap", frames))
    for topic in ("/text", "/unset", "/rare"):
        assert topic not in proposed


def test_topics_that_ros_could_not_have_are_left_out(tmp_path):
    strange = jittery("/a<script>", period_ms=100, jitter_ms=3, count=50, seed=3)
    proposed, sets = _proposed(write_mcap(tmp_path / "rig.mcap", merged(strange, _stereo_and_lidar())))
    assert "script" not in proposed
    assert sets["fused"] >= 49


def test_what_nodes_say_of_themselves_is_no_sensor(tmp_path):
    said = [
        Frame(
            "/diagnostics", DIAGNOSTICS, BEGIN + n * 100 * MS, serialize(DIAGNOSTICS, header(BEGIN + n * 100 * MS), [])
        )
        for n in range(50)
    ]
    proposed, sets = _proposed(write_mcap(tmp_path / "rig.mcap", merged(said, _stereo_and_lidar())))
    assert "/diagnostics" not in proposed
    assert sets["fused"] >= 49


@pytest.mark.parametrize("frames", [[], at("/one", *range(0, 5000, 100))], ids=["few", "one"])
def test_a_recording_with_nothing_to_match_is_named(frames, tmp_path):
    path = write_mcap(tmp_path / "rig.mcap", [*frames, *at("/rare", 1)])
    with (
        closing(open_recording([str(path)])) as recording,
        pytest.raises(NothingToMatchError, match="there is nothing to match"),
    ):
        propose(recording)


_REAL = (
    recordings.VEHICLE,
    recordings.HUSKY,
    "gps_odom_uf_rosbag2/bag",
    "multicam_tagslam/test_2.tag_detections.bag.bz2",
    "multicam_tagslam/test_14.tag_detections.bag.bz2",
    "multicam_tagslam/test_21.tag_detections.bag.bz2",
)


@pytest.mark.real_data
@pytest.mark.parametrize("bag", _REAL)
def test_real_recordings_get_a_file_that_gives_sets(bag, real_data: Path):
    text, sets = _proposed(real_data / bag)
    assert text.startswith("version: 1\ngroups:\n")
    assert sets
    assert all(count > 90 for count in sets.values())
