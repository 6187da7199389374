"""What is printed: aligned, and as its page shows it."""

from pathlib import Path

import pytest

from syncrelay.doctor.diagnosis import Diagnosis, Severity, error, info, worst_first
from syncrelay.doctor.discovery import check_discovery
from syncrelay.doctor.examine import Observed
from syncrelay.doctor.graph import check_groups
from syncrelay.doctor.report import diagnosis_lines, observed_lines, verdict
from syncrelay.explain import Endpoint, GraphSnapshot, GroupReport, judge, with_ok
from syncrelay.sync.counts import InputCounts
from tests.explain.support.groups import S, a_group, a_silent_group, an_input

ROOT = Path(__file__).parents[2]
IMAGE, CLOUD, IMU = "sensor_msgs/msg/Image", "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Imu"
MS = 1_000_000


def test_a_block_is_aligned_under_its_label_and_moves_no_cursor():
    found = error("code", "what\nmore", impact="impact", fix="fix\x1b[2J\nthis")
    assert list(diagnosis_lines(found, colour=False)) == [
        "error    what",
        "         more",
        "         impact: impact",
        r"         fix:    fix\x1b[2J",
        "                 this",
    ]
    assert next(diagnosis_lines(found, colour=True)).startswith("\033[31merror")
    alone = Diagnosis("code", Severity.WARNING, "what", None, "fix")
    assert list(diagnosis_lines(alone, colour=False)) == ["warning  what", "         fix:    fix"]


A, B = error("a", "a", impact="", fix=""), info("b", "b", impact="", fix="")
W = Diagnosis("w", Severity.WARNING, "w", None, None)


@pytest.mark.parametrize(
    ("found", "text"),
    [
        ([], "no problems found"),
        ([A], "1 error"),
        ([W], "1 warning"),
        ([B], "no problems found, 1 info"),
        ([A, W, B, A, W, B], "2 errors, 2 warnings, 2 info"),
    ],
)
def test_the_verdict_counts(found, text):
    assert verdict(found) == text


def test_the_worst_comes_first_else_in_order():
    assert [each.code for each in worst_first([B, W, A, B, A])] == ["a", "a", "w", "b", "b"]


@pytest.mark.parametrize(
    ("delay", "text"),
    [
        (2_500_000, "stamps 2.5 ms old"),
        (-12 * MS, "stamps 12 ms ahead"),
        (37_200 * MS, "stamps 37.2 s old"),
        (7_200 * S, "stamps 2 h old"),
    ],
)
def test_the_age_of_stamps_is_in_the_unit_that_reads_best(delay, text):
    assert f"  {text}  /driver" in shown(an_input(figures={"delay": delay}))


def shown(*inputs):
    facts = a_group(*inputs)
    lines = list(observed_lines(Observed(5.0, GraphSnapshot(0, "SUBNET"), (GroupReport(facts, ()),))))
    return lines[1]


def test_a_publisher_of_another_type_is_listed_with_it():
    assert shown(an_input(publishers=(Endpoint("/ouster", CLOUD),))).endswith("/ouster (sensor_msgs/msg/PointCloud2)")


def test_a_type_that_is_not_known_yet_is_told_with_the_publishers_types():
    publishers = (Endpoint("/ouster", CLOUD), Endpoint("/other", IMAGE))
    said = shown(an_input(type=None, publishers=publishers))
    assert "type not known yet" in said
    assert said.endswith("/ouster (sensor_msgs/msg/PointCloud2); /other (sensor_msgs/msg/Image)")


def test_a_healthy_group_is_told_with_its_figures():
    facts = a_group()
    lines = list(observed_lines(Observed(5.0, GraphSnapshot(0, "SUBNET"), (GroupReport(facts, ()),))))
    assert lines[-1] == f"  front: {with_ok(facts, ())[0].text}"


def test_its_page_shows_what_is_printed():
    nothing = {"last_received": None, "rate_hz": 0.0, "usual_hz": 0.0, "delay": None}
    never = InputCounts(0, 0, {}, 0)
    camera = an_input(
        "/camera/image_raw", node="/camera_driver", type=IMAGE, figures={"rate_hz": 29.97, "delay": 31 * MS}
    )
    lidar = an_input(
        "/lidar/points", publishers=(), type=CLOUD, counts=never, figures=nothing, alike=("/ouster/points",)
    )
    imu = an_input(
        "/imu/data", publishers=(Endpoint("/imu_driver", IMU),), type=IMU, figures={"rate_hz": 199.8, "delay": 2 * MS}
    )
    facts = a_silent_group(camera, lidar, imu)
    reports = (GroupReport(facts, judge(facts)),)
    graph = GraphSnapshot(110, "SUBNET", ("/camera_driver", "/imu_driver", "/ouster"), 7)
    found = worst_first(
        [*check_discovery({"ROS_DOMAIN_ID": "110"}, ephemeral_ports=(32768, 60999)), *check_groups(reports, ())]
    )
    lines = list(observed_lines(Observed(5.0, graph, reports)))
    for each in found:
        lines += ["", *diagnosis_lines(each, colour=False)]
    lines += ["", verdict(found)]
    assert "\n".join(lines) in (ROOT / "docs/howto/before_a_message_flows.md").read_text(), "\n".join(lines)
