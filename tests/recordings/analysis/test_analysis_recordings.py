"""The analysis finds what the source of each real recording says of it; its values reach 99 % of what is possible."""

import heapq
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import pytest

from syncrelay.config import load_text
from syncrelay.recordings.analysis import Analysis, analyze, proposed_text, with_suggestions
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import bind
from tests.recordings.bag.making import write_mcap
from tests.ros import recordings
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.frames import Frame

pytestmark = pytest.mark.real_data

_BOREAS = "boreas/boreas-2021-08-05-13-34"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """Topics of a recording as one group, and what is known of them."""

    bag: str = ""
    topics: tuple[str, ...]
    figures: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Of topics: what their figures are."""
    delays_us: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Of topics: the median delay and the greatest."""
    distances_us: dict[tuple[str, str], tuple[int, int, int]] = field(default_factory=dict)
    """Of pairs of topics: the median, the 95th percentile and the greatest distance."""
    options: dict[str, Any] = field(default_factory=dict)
    """What is suggested."""
    sets: int | None = None
    more_than: int = 9
    """There are more possible sets than that."""


_GPS = "gps_odom_uf_rosbag2/bag"
_RIGHT, _FISHEYE, _LEFT, _OTHER = "/right_tof/tags", "/t265/fisheye1/tags", "/left_tof/tags", "/t265/fisheye2/tags"
_FIX, _ODOM, _IMU = "/fix", "/husky_velocity_controller/odom", "/imu/data"
_RIGS: Final = {
    # One epoch, some microseconds apart: exact_time matches nothing.
    "vehicle, one epoch": Rig(
        bag=recordings.VEHICLE,
        topics=("/imu_data", "/magnetic_vector", "/gravity_vector"),
        delays_us={"/imu_data": (81_259, 681_362)},
        distances_us={("/imu_data", "/magnetic_vector"): (10, 11, 22), ("/imu_data", "/gravity_vector"): (11, 13, 23)},
        options={"policy": "approximate_time", "slop": 25_000},
    ),
    "vehicle, scan": Rig(
        bag=recordings.VEHICLE,
        topics=("/imu_data", "/scan"),
        distances_us={("/imu_data", "/scan"): (12_053, 23_076, 25_010)},
    ),
    "vehicle, repeated stamps": Rig(
        bag=recordings.VEHICLE,
        topics=("/velocity", "/scan"),
        figures={"/velocity": {"messages": 712, "duplicates": 356}},
    ),
    "husky": Rig(
        bag=recordings.HUSKY,
        topics=(_FIX, _ODOM, _IMU),
        figures={_ODOM: {"gaps": 2, "longest_gap": 208_241_235}},
        delays_us={_IMU: (25_154, 36_331), _FIX: (280, 617), _ODOM: (437, 907)},
        distances_us={(_FIX, _ODOM): (6748, 14_372, 96_251)},
    ),
    # Recorded again 66 days later.
    "gps": Rig(
        bag=_GPS,
        topics=("/gps", "/odometry"),
        delays_us={"/gps": (5_700_748_426_499, 5_700_748_432_640), "/odometry": (5_700_748_426_515, 5_700_748_445_308)},
        distances_us={("/gps", "/odometry"): (23_608, 26_021, 27_595)},
    ),
    "gps without stamps": Rig(
        bag=_GPS,
        topics=("/gps", "/odometry", "/vehicle_pose"),
        figures={"/vehicle_pose": {"messages": 2034, "unstamped": 2034}},
    ),
    "stereo": Rig(
        bag="multicam_tagslam/test_2.tag_detections.bag.bz2",
        topics=("/stereo/left/tags", "/stereo/right/tags"),
        options={"policy": "exact_time"},
        sets=778,
    ),
    "four cameras": Rig(
        bag="multicam_tagslam/test_14.tag_detections.bag.bz2",
        topics=tuple(f"/quadruple/{side}/tags" for side in ("top_right", "bottom_right", "bottom_left", "top_left")),
        options={"policy": "exact_time"},
        sets=5178,
    ),
    "tof and t265": Rig(
        bag="multicam_tagslam/test_21.tag_detections.bag.bz2",
        topics=(_RIGHT, _FISHEYE, _LEFT, _OTHER),
        distances_us={
            (_RIGHT, _LEFT): (15_590, 16_006, 19_008),
            (_RIGHT, _FISHEYE): (5169, 19_850, 22_722),
            (_FISHEYE, _LEFT): (11_725, 20_914, 23_223),
            (_FISHEYE, _OTHER): (0, 0, 0),
        },
    ),
    "packets": Rig(bag="ouster_packets/512x10_raw.bag", topics=("/os_node0/imu_packets", "/os_node0/lidar_packets")),
    "boreas": Rig(
        topics=("/camera", "/lidar", "/radar"),
        figures={
            "/camera": {"period": 100_001_000, "gaps": 44},
            "/lidar": {"period": 103_699_000},
            "/radar": {"period": 250_005_885},
        },
        distances_us={
            ("/lidar", "/camera"): (24_903, 47_811, 74_769),
            ("/radar", "/camera"): (26_088, 36_220, 73_651),
            ("/radar", "/lidar"): (25_971, 49_269, 186_250),
        },
        more_than=650,
    ),
    "tum": Rig(topics=(recordings.RGB, recordings.DEPTH), more_than=650),
}


@pytest.mark.parametrize("name", _RIGS)
def test_what_its_source_says_is_found_and_suggested_values_reach_99_percent_of_the_possible_sets(
    name: str, real_data: Path, tmp_path: Path
):
    rig = _RIGS[name]
    bag = real_data / rig.bag if rig.bag else write_mcap(tmp_path / "stamps.mcap", _STAMPS[name](real_data))
    analysis = _analyzed(bag, rig.topics)
    (group,) = analysis.groups
    topics = {topic.topic: topic for topic in analysis.topics}
    for topic, figures in rig.figures.items():
        assert {key: getattr(topics[topic], key) for key in figures} == figures, topic
    for topic, known in rig.delays_us.items():
        delay = topics[topic].delay
        assert delay is not None
        assert (_us(delay.median), _us(delay.greatest)) == known, topic
    distances = {frozenset((pair.first, pair.second)): pair.distance for pair in group.pairs}
    for pair, distance in rig.distances_us.items():
        found = distances[frozenset(pair)]
        assert (_us(found.median), _us(found.high), _us(found.greatest)) == distance, pair
    assert group.possible is not None
    assert len(group.possible.spans) > rig.more_than
    assert len(group.evaluation.sets) >= 0.99 * len(group.possible.spans)
    assert rig.sets in (None, len(group.evaluation.sets))
    assert group.group.options.model_dump().items() >= rig.options.items()


def _us(ns: int) -> int:
    return round(ns / 1000)


def _analyzed(bag: Path, topics: Sequence[str]) -> Analysis:
    """The analysis of topics as one group, with the values that are suggested."""
    with closing(open_recording([str(bag)])) as recording:
        channels = {channel.topic: channel for channel in recording.channels}
        text = proposed_text("matched", [channels[topic] for topic in topics])
        return with_suggestions(analyze(recording, text, bind(load_text(text), recording)))


def _boreas(data: Path) -> list[Frame]:
    """The stamps of camera, lidar and radar, received when they are stamped."""

    def frames(name: str) -> list[Frame]:
        rows = (data / _BOREAS / f"{name}_poses.csv").read_text().splitlines()[1:]
        stamps = [int(row.partition(",")[0]) for row in rows]
        # Of this drive, the radar's alone are nanoseconds.
        scale = 1 if stamps[0] > 10**17 else 1000
        return [Frame(f"/{name}", VECTOR, stamp * scale, vector(stamp * scale)) for stamp in stamps]

    return list(heapq.merge(*map(frames, ("camera", "lidar", "radar")), key=lambda frame: frame.time))


_STAMPS: Final = {"boreas": _boreas, "tum": recordings.tum_stamps}
