"""What is printed: aligned, and as the README shows it."""

from pathlib import Path

import pytest

from syncrelay.doctor.diagnosis import Severity, know, mend, worst_first
from syncrelay.doctor.discovery import Discovery, check_discovery
from syncrelay.doctor.graph import check_topics
from syncrelay.doctor.stamps import Matched, check_stamps
from syncrelay.doctor.text import diagnosis_lines, sighting_lines, verdict
from syncrelay.doctor.words import duration
from syncrelay.ros.sighting import SeenPublisher, SeenTopic, Sighting

ROOT = Path(__file__).parents[2]
IMAGE, CLOUD = "sensor_msgs/msg/Image", "sensor_msgs/msg/PointCloud2"
MS = 1_000_000


def test_a_block_is_aligned_under_its_label():
    found = mend("code", "what\nmore", so="so", do="do\nthis")
    assert list(diagnosis_lines(found, colour=False)) == [
        "mend  what",
        "      more",
        "      so  so",
        "      do  do",
        "          this",
    ]
    assert next(diagnosis_lines(found, colour=True)).startswith("\033[31mmend")


def test_what_would_move_the_cursor_is_escaped():
    found = know("code", "a\x1b[2Jb", so="c\rd", do="e")
    assert "\x1b" not in "".join(diagnosis_lines(found, colour=False))


A, B = mend("a", "a", so="", do=""), know("b", "b", so="", do="")


@pytest.mark.parametrize(
    ("found", "text"),
    [
        ([], "nothing to mend"),
        ([A], "1 thing to mend"),
        ([B], "nothing to mend, 1 to know"),
        ([A, A, B, B], "2 things to mend, 2 to know"),
    ],
)
def test_the_verdict_counts(found, text):
    assert verdict(found) == text


def test_the_worst_comes_first_else_in_order():
    assert [each.code for each in worst_first([B, A, B, A])] == ["a", "a", "b", "b"]
    assert worst_first([B])[0].severity is Severity.KNOW


@pytest.mark.parametrize(
    ("ns", "text"),
    [
        (0, "0 ms"),
        (2_500_000, "2.5 ms"),
        (-12 * MS, "-12 ms"),
        (812 * MS, "812 ms"),
        (37_200 * MS, "37.2 s"),
        (150_000 * MS, "2.5 min"),
        (7_200_000 * MS, "2 h"),
        (86_400_000 * MS * 20_000, "20000 d"),
    ],
)
def test_durations_are_in_the_unit_that_reads_best(ns, text):
    assert duration(ns) == text


def test_a_publisher_of_another_type_is_listed_with_it():
    stranger = SeenPublisher("/ouster", CLOUD, "reliable, volatile")
    seen = Sighting(5.0, ("/ouster",), 1, topics=(SeenTopic("/scan", "sensor_msgs/msg/LaserScan", (stranger,)),))
    assert list(sighting_lines(seen))[1].endswith(
        "0 received    /ouster (sensor_msgs/msg/PointCloud2, reliable, volatile)"
    )


def test_the_readme_shows_what_is_printed():
    driver = SeenPublisher("/camera_driver", IMAGE, "reliable, volatile")
    camera = SeenTopic("/camera/image_raw", IMAGE, (driver,), 150, 29.97, delays=(37_231 * MS,))
    lidar = SeenTopic("/lidar/points", CLOUD, alike=("/ouster/points",))
    imu_driver = SeenPublisher("/imu_driver", "sensor_msgs/msg/Imu", "best_effort, volatile")
    imu = SeenTopic("/imu/data", "sensor_msgs/msg/Imu", (imu_driver,), 998, 199.8, delays=(2 * MS,))
    seen = Sighting(5.0, ("/camera_driver", "/imu_driver", "/ouster"), 7, topics=(camera, lidar, imu))
    found = worst_first(
        [
            *check_discovery(Discovery({"ROS_DOMAIN_ID": "110"}, (32768, 60999))),
            *check_topics(seen, optional=frozenset()),
            *check_stamps(
                seen.topics, [Matched("front", {"/camera/image_raw": 0, "/lidar/points": 0, "/imu/data": 0})]
            ),
        ]
    )
    lines = list(sighting_lines(seen))
    for each in found:
        lines += ["", *diagnosis_lines(each, colour=False)]
    lines += ["", verdict(found)]
    assert "\n".join(lines) in (ROOT / "README.md").read_text(), "\n".join(lines)
