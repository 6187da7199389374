"""Real recordings in stretches: the sets, drops and counts are those of one pass, whatever the policy."""

from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest

from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.stretches import cut
from tests.faults.extent import IS_LONG
from tests.recordings.bag.making import write_mcap
from tests.recordings.bag.stretch_tasks import Stretches, one_pass
from tests.ros import recordings
from tests.ros.configs import config

pytestmark = pytest.mark.real_data

_EACH = (2, 3, 4, 5, 6, 7)


@dataclass(frozen=True)
class Case:
    """Topics of a recording, the slop that fits them, how many sets approximate_time makes, how often it is cut.

    Where it is regular, no stretch has to be replayed again.
    """

    bag: str
    topics: tuple[str, ...]
    slop: str
    sets: int
    counts: tuple[int, ...] = _EACH
    stamp: str = "header"
    is_regular: bool = True
    is_large: bool = False


_CASES = {
    "odometry": Case(
        "gps_odom_uf_rosbag2/bag", ("/vehicle_pose", "/odometry", "/gps"), "60ms", 101, (4, 7), stamp="receive"
    ),
    "one topic": Case(
        "event_camera_mcap/test_events_2",
        ("/event_camera/events", "/event_camera/missing"),
        "5ms",
        0,
        stamp="receive",
        is_regular=False,
    ),
    "packets": Case(
        "ouster_packets/512x10_raw.bag",
        ("/os_node0/imu_packets", "/os_node0/lidar_packets"),
        "5ms",
        10,
        stamp="receive",
        is_regular=False,
    ),
    "two cameras": Case(
        "multicam_tagslam/test_2.tag_detections.bag.bz2", ("/stereo/left/tags", "/stereo/right/tags"), "20ms", 778, (3,)
    ),
    "four cameras": Case(
        "multicam_tagslam/test_14.tag_detections.bag.bz2",
        tuple(f"/quadruple/{side}/tags" for side in ("top_right", "bottom_right", "bottom_left", "top_left")),
        "20ms",
        5178,
        (2,),
        is_large=True,
    ),
    "time of flight": Case(
        "multicam_tagslam/test_21.tag_detections.bag.bz2",
        ("/right_tof/tags", "/left_tof/tags", "/vio_node/odom"),
        "20ms",
        367,
        (6,),
    ),
    "one image": Case(
        "raspicam_fiducials/aruco_images.bag",
        ("/raspicam_node/camera_info", "/raspicam_node/image/compressed"),
        "20ms",
        0,
        is_regular=False,
    ),
    "husky": Case(
        recordings.HUSKY, ("/fix", "/husky_velocity_controller/odom", "/imu/data"), "60ms", 928, (3,), is_large=True
    ),
    "vehicle": Case(recordings.VEHICLE, ("/imu_data", "/magnetic_vector", "/scan"), "30ms", 178),
    "kinect": Case("tum", (recordings.RGB, recordings.DEPTH), "20ms", 696, is_large=True),
}


def text_of(case):
    """A group for each policy that goes by such stamps, one with an optional input, and one that is thinned."""
    topics = [{"topic": topic, "stamp": case.stamp} for topic in case.topics]
    optional = [*topics[:-1], {**topics[-1], "required": len(topics) == 1}]
    near = {"slop": case.slop, "topics": topics}
    groups = {
        "near": {"policy": "approximate_time", **near},
        "eager": {"policy": "approximate_time_eager", **near},
        "epsilon": {"policy": "approximate_epsilon_time", **near},
        "latest": {"policy": "latest_time", "trigger": case.topics[0], "max_age": "300ms", "topics": topics},
        "optional": {"policy": "approximate_time", **near, "max_wait": "150ms", "topics": optional},
        "thinned": {"policy": "approximate_time", **near, "max_rate": "2 Hz"},
    }
    if case.stamp == "header":
        groups["exact"] = {"policy": "exact_time", "topics": topics}
        groups["keyed"] = {"policy": "equal_key", "key": "header.stamp", "topics": topics}
    return config(groups)


def path_of(case, data: Path, folder: Path) -> Path:
    return (
        write_mcap(folder / "tum.mcap", recordings.tum_stamps(data), chunk_size=2000)
        if case.bag == "tum"
        else data / case.bag
    )


@pytest.mark.faults
@pytest.mark.parametrize("name", _CASES)
def test_two_to_seven_stretches_give_the_sets_of_one_pass(name, real_data, tmp_path):
    case = _CASES[name]
    if case.is_large and not IS_LONG:
        pytest.skip("takes 2 to 4 s of CPU: `make faults` does it")
    path, text = path_of(case, real_data, tmp_path), text_of(case)
    opened = partial(open_recording, [str(path)])
    whole = one_pass(opened, text)
    assert [sets for group, sets, _ in whole[1] if group == "near"] == [case.sets]
    with closing(opened()) as recording:
        span = recording.end - recording.begin
        cuts = [cut(recording, length_ns=-(-span // count), lead_in_ns=span // 7) for count in case.counts]
    for count, stretches in zip(case.counts, cuts, strict=True):
        assert len(stretches) == count
        task = Stretches(opened, text)
        assert task.joined(stretches) == whole
        assert not (case.is_regular and task.redone)
