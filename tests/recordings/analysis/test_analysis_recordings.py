"""The analysis finds what the source of each real recording says of it; its values reach 99 % of what is possible."""

import heapq
import os
from contextlib import closing
from functools import cache
from pathlib import Path

import pytest

from syncrelay.config import load_text
from syncrelay.recordings.analysis import Analysis, analyze, proposed_text, with_suggestions
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import bind
from tests.recordings.bag.making import write_mcap
from tests.ros import recordings
from tests.ros.cdr_messages import NS_PER_SECOND, VECTOR, vector
from tests.ros.frames import Frame

pytestmark = pytest.mark.real_data

_MS = 1_000_000
_US = 1_000
_GPS = "gps_odom_uf_rosbag2/bag"
_TOF = "multicam_tagslam/test_21.tag_detections.bag.bz2"
_BOREAS = "boreas/boreas-2021-08-05-13-34"


@cache
def _analyzed(bag: Path, topics: tuple[str, ...]) -> Analysis:
    """The analysis of topics as one group, with the values that are suggested."""
    with closing(open_recording([str(bag)])) as recording:
        channels = {channel.topic: channel for channel in recording.channels}
        text = proposed_text("matched", [channels[topic] for topic in topics])
        bindings = bind(load_text(text), recording)
        return with_suggestions(analyze(recording, text, bindings))


@pytest.fixture(scope="module")
def boreas(tmp_path_factory) -> Path:
    """The stamps of camera, lidar and radar as a recording, received when they are stamped."""
    data = Path(os.environ["SYNCRELAY_REAL_DATA"])

    def frames(name: str) -> list[Frame]:
        rows = (data / _BOREAS / f"{name}_poses.csv").read_text().splitlines()[1:]
        stamps = [int(row.partition(",")[0]) for row in rows]
        # Of this drive, the radar's alone are nanoseconds.
        scale = 1 if stamps[0] > 10**17 else 1000
        return [Frame(f"/{name}", VECTOR, stamp * scale, vector(stamp * scale)) for stamp in stamps]

    merged = heapq.merge(*map(frames, ("camera", "lidar", "radar")), key=lambda frame: frame.time)
    return write_mcap(tmp_path_factory.mktemp("boreas") / "boreas.mcap", list(merged))


def _topic(analysis: Analysis, name: str):
    return next(topic for topic in analysis.topics if topic.topic == name)


def _distance(analysis: Analysis, *names: str):
    return next(pair.distance for pair in analysis.groups[0].pairs if {pair.first, pair.second} == set(names))


def test_the_mtig_stamps_one_epoch_some_microseconds_apart_and_exact_time_matches_nothing(real_data: Path):
    bag = real_data / recordings.VEHICLE
    topics = ("/imu_data", "/magnetic_vector", "/gravity_vector", "/position_gps")
    analysis = _analyzed(bag, topics)
    (group,) = analysis.groups
    for pair in group.pairs:
        assert pair.distance.least > 0
        assert pair.distance.median <= 14 * _US
    assert group.possible is not None
    assert group.possible.spans.min() > 0
    assert group.possible.widest <= 30 * _US
    assert group.group.options.policy == "approximate_time"
    assert group.group.options.model_dump()["slop"] <= 30 * _US
    assert _topic(analysis, "/imu_data").delay.median == pytest.approx(81 * _MS, abs=_MS)
    assert _topic(analysis, "/imu_data").delay.greatest == pytest.approx(681 * _MS, abs=_MS)


def test_the_mtig_publishes_each_velocity_twice_with_one_stamp(real_data: Path):
    velocity = _topic(_analyzed(real_data / recordings.VEHICLE, ("/velocity", "/scan")), "/velocity")
    assert (velocity.messages, velocity.duplicates) == (712, 356)


def test_the_scan_is_not_synchronized_with_the_imu(real_data: Path):
    distance = _distance(_analyzed(real_data / recordings.VEHICLE, ("/imu_data", "/scan")), "/imu_data", "/scan")
    assert [round(each / _MS, 1) for each in (distance.median, distance.high, distance.greatest)] == [12.1, 23.1, 25.0]


def test_the_gps_was_recorded_again_66_days_later(real_data: Path):
    analysis = _analyzed(real_data / _GPS, ("/gps", "/odometry"))
    for topic in analysis.topics:
        assert topic.delay is not None
        assert topic.delay.median // NS_PER_SECOND == 5_700_748
    distance = _distance(analysis, "/gps", "/odometry")
    assert [round(each / _MS, 1) for each in (distance.median, distance.high, distance.greatest)] == [23.6, 26.0, 27.6]


def test_the_vehicle_pose_has_no_stamps(real_data: Path):
    analysis = _analyzed(real_data / _GPS, ("/gps", "/odometry", "/vehicle_pose"))
    pose = _topic(analysis, "/vehicle_pose")
    assert (pose.messages, pose.unstamped) == (2034, 2034)
    assert {topic.stamp for topic in analysis.groups[0].group.topics} == {"receive"}


def test_the_tof_cameras_are_not_synchronized_with_the_t265(real_data: Path):
    right, fisheye, left = ("/right_tof/tags", "/t265/fisheye1/tags", "/left_tof/tags")
    analysis = _analyzed(real_data / _TOF, (right, fisheye, left, "/t265/fisheye2/tags"))
    measured = {
        names: [round(each / _MS, 1) for each in (distance.median, distance.high, distance.greatest)]
        for names in ((right, left), (right, fisheye), (fisheye, left))
        for distance in [_distance(analysis, *names)]
    }
    assert measured[right, left] == [15.6, 16.0, 19.0]
    assert measured[right, fisheye] == [5.2, 19.8, 22.7]
    assert measured[fisheye, left][:2] == [11.7, 20.9]
    assert _distance(analysis, fisheye, "/t265/fisheye2/tags").greatest == 0


def test_the_huskys_imu_arrives_25_ms_late(real_data: Path):
    fix, odom, imu = ("/fix", "/husky_velocity_controller/odom", "/imu/data")
    analysis = _analyzed(real_data / recordings.HUSKY, (fix, odom, imu))
    delays = {topic.topic: topic.delay for topic in analysis.topics if topic.delay is not None}
    assert delays[imu].median == pytest.approx(25.2 * _MS, abs=0.1 * _MS)
    assert delays[imu].greatest == pytest.approx(36.3 * _MS, abs=0.1 * _MS)
    assert delays[fix].median == pytest.approx(0.28 * _MS, abs=0.01 * _MS)
    assert delays[odom].median == pytest.approx(0.44 * _MS, abs=0.01 * _MS)
    assert (_topic(analysis, odom).gaps, _topic(analysis, odom).longest_gap // _MS) == (2, 208)
    assert round(_distance(analysis, fix, odom).greatest / _MS) == 96


def test_boreas_has_rates_that_beat(boreas: Path):
    analysis = _analyzed(boreas, ("/camera", "/lidar", "/radar"))
    # As sources count it: a rate while it runs, with gaps left out of the period.
    assert [topic.period and round(NS_PER_SECOND / topic.period, 1) for topic in analysis.topics] == [10.0, 9.6, 4.0]
    camera, lidar, radar = (topic.topic for topic in analysis.topics)
    distance = _distance(analysis, lidar, camera)
    assert [round(each / _MS, 1) for each in (distance.median, distance.high, distance.greatest)] == [24.9, 47.8, 74.8]
    distance = _distance(analysis, radar, camera)
    assert [round(each / _MS, 1) for each in (distance.median, distance.high)] == [26.1, 36.2]
    distance = _distance(analysis, radar, lidar)
    assert [round(each / _MS) for each in (distance.median, distance.high, distance.greatest)] == [26, 49, 186]
    assert _topic(analysis, camera).gaps > 0


_GROUPS = {
    "vehicle, one epoch": (recordings.VEHICLE, ("/imu_data", "/magnetic_vector", "/gravity_vector")),
    "vehicle, scan": (recordings.VEHICLE, ("/imu_data", "/scan")),
    "vehicle, repeated stamps": (recordings.VEHICLE, ("/velocity", "/scan")),
    "husky": (recordings.HUSKY, ("/fix", "/husky_velocity_controller/odom", "/imu/data")),
    "gps": (_GPS, ("/gps", "/odometry")),
    "gps without stamps": (_GPS, ("/gps", "/odometry", "/vehicle_pose")),
    "stereo": ("multicam_tagslam/test_2.tag_detections.bag.bz2", ("/stereo/left/tags", "/stereo/right/tags")),
    "four cameras": (
        "multicam_tagslam/test_14.tag_detections.bag.bz2",
        tuple(f"/quadruple/{side}/tags" for side in ("top_right", "bottom_right", "bottom_left", "top_left")),
    ),
    "tof and t265": (_TOF, ("/right_tof/tags", "/t265/fisheye1/tags", "/left_tof/tags", "/vio_node/odom")),
    "packets": ("ouster_packets/512x10_raw.bag", ("/os_node0/imu_packets", "/os_node0/lidar_packets")),
}
# What their sources say: exact pairs and exact sets of four.
_EXACT = {"stereo": 778, "four cameras": 5178}


@pytest.mark.parametrize("name", _GROUPS)
def test_suggested_values_reach_99_percent_of_the_possible_sets(name, real_data: Path):
    bag, topics = _GROUPS[name]
    (group,) = _analyzed(real_data / bag, topics).groups
    assert group.possible is not None
    assert len(group.possible.spans) > 9
    assert len(group.evaluation.sets) >= 0.99 * len(group.possible.spans)
    if name in _EXACT:
        assert (group.group.options.policy, len(group.evaluation.sets)) == ("exact_time", _EXACT[name])


def test_suggested_values_reach_99_percent_of_what_boreas_and_tum_have(real_data: Path, boreas: Path, tmp_path):
    tum = write_mcap(tmp_path / "tum.mcap", recordings.tum_stamps(real_data))
    for bag, topics in ((tum, (recordings.RGB, recordings.DEPTH)), (boreas, ("/camera", "/lidar", "/radar"))):
        (group,) = _analyzed(bag, topics).groups
        assert group.possible is not None
        assert len(group.possible.spans) > 650
        assert len(group.evaluation.sets) >= 0.99 * len(group.possible.spans)
