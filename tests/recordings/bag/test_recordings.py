"""Real recordings replayed: byte for byte the sets that come out over DDS (tests/ros/test_real_recordings.py)."""

from collections import Counter
from pathlib import Path

import pytest
from rosbags.rosbag2 import Reader

from syncrelay.recordings.bag.mcap_output import McapOutput
from syncrelay.recordings.bag.replay import replay
from syncrelay.recordings.bag.writing import SetWriter
from tests.recordings.bag.making import write_mcap
from tests.recordings.bag.reading import bound, read
from tests.ros import recordings, relaying, test_real_recordings
from tests.ros.cdr_messages import stamp_of
from tests.ros.configs import config, inputs, outputs

pytestmark = pytest.mark.real_data

_CASES = [
    test_real_recordings.IMU_MAGNETIC_EXACT,
    test_real_recordings.IMU_MAGNETIC,
    test_real_recordings.IMU_SCAN,
    test_real_recordings.FIX_ODOM_IMU,
    test_real_recordings.RGB_DEPTH,
    test_real_recordings.PICTURES,
]
_BAGS = {
    "imu_magnetic_exact": recordings.VEHICLE,
    "imu_magnetic": recordings.VEHICLE,
    "imu_scan": recordings.VEHICLE,
    "fix_odom_imu": recordings.HUSKY,
}


@pytest.mark.parametrize("case", _CASES, ids=lambda case: case.name)
def test_the_sets_of_a_replay_are_those_that_the_relay_gives(case, real_data: Path, tmp_path):
    frames = case.read(real_data, case.topics)
    named = _BAGS.get(case.name)
    bag = real_data / named if named else write_mcap(tmp_path / "bag.mcap", frames)
    types = relaying.topics_of(frames)
    group = {**case.group, "manifest": False, "topics": inputs({topic: types[topic] for topic in case.topics})}
    with bound(bag, text=config({case.name: group})) as (recording, bindings), McapOutput(tmp_path / "out") as output:
        writer = SetWriter(output)
        for binding in bindings:
            writer.begin(binding)
        (result,) = replay(recording, bindings, listeners=[writer.take])
    assert result.sets == case.sets
    expected = relaying.matched_by_engine(case.policy(), frames, case.topics)
    aligned = outputs(case.name, case.topics)
    with Reader(tmp_path / "out") as reader:
        written: dict[str, list[bytes]] = {topic: [] for topic in aligned}
        for connection, _, payload in reader.messages():
            written[connection.topic].append(payload)
    sets = list(zip(*(written[topic] for topic in aligned), strict=True))
    assert [tuple(map(stamp_of, a_set)) for a_set in sets] == [tuple(map(stamp_of, a_set)) for a_set in expected]
    assert sets == expected


_TYPES = {
    "event_camera_mcap/test_events_2": {"/event_camera/events": ("event_camera_msgs/msg/EventPacket", 100)},
    "gps_odom_uf_rosbag2/bag": {
        "/gps": ("sensor_msgs/msg/NavSatFix", 107),
        "/odometry": ("nav_msgs/msg/Odometry", 2143),
        "/vehicle_pose": ("geometry_msgs/msg/PoseStamped", 2034),
        "/vehicle_command_ackermann": ("ackermann_msgs/msg/AckermannDriveStamped", 1034),
    },
    "ouster_packets/512x10_raw.bag": {
        "/os_node0/lidar_packets": ("ouster_ros/msg/PacketMsg", 32),
        "/os_node0/imu_packets": ("ouster_ros/msg/PacketMsg", 10),
    },
    "multicam_tagslam/test_2.tag_detections.bag.bz2": {
        "/stereo/left/tags": ("apriltag_msgs/msg/ApriltagArrayStamped", 817),
        "/stereo/right/tags": ("apriltag_msgs/msg/ApriltagArrayStamped", 1072),
    },
    "raspicam_fiducials/aruco_images.bag": {
        "/raspicam_node/camera_info": ("sensor_msgs/msg/CameraInfo", 15),
        "/raspicam_node/image/compressed": ("sensor_msgs/msg/CompressedImage", 1),
    },
}


@pytest.mark.parametrize("bag", _TYPES)
def test_real_recordings_hold_what_their_sources_say(bag, real_data: Path):
    frames, faults, _ = read(real_data / bag, topics=set(_TYPES[bag]))
    counts = Counter((frame.topic, frame.type_name) for frame in frames)
    assert {topic: (type_name, count) for (topic, type_name), count in counts.items()} == _TYPES[bag]
    assert faults == []
