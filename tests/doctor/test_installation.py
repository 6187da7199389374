from dataclasses import replace
from pathlib import Path

import pytest

from syncrelay.doctor.diagnosis import Severity
from syncrelay.doctor.installation import Installation, check_installation, middleware_of

WHEELS = Installation(
    python=(3, 12),
    executable="/venv/bin/python",
    machine="x86_64",
    distribution=None,
    rclpy=Path("/venv/lib/rclpy"),
    version="7.1.6",
    built_for=((3, 12),),
    wheels=True,
    sourced=(),
    unsourced=(),
    middlewares=("rmw_fastrtps_cpp",),
    middleware_asked=None,
)
SOURCED = replace(WHEELS, wheels=False, distribution="jazzy", sourced=(Path("/opt/ros/jazzy"),))
NOTHING = replace(WHEELS, rclpy=None, version=None, built_for=(), wheels=False, middlewares=())


@pytest.mark.parametrize(
    "found",
    [
        WHEELS,
        SOURCED,
        replace(WHEELS, middleware_asked="rmw_fastrtps_cpp"),
        replace(WHEELS, unsourced=(Path("/opt/ros/jazzy"),)),
        replace(WHEELS, built_for=((3, 11), (3, 12))),
    ],
)
def test_what_belongs_together_is_passed_over(found):
    assert list(check_installation(found)) == []


@pytest.mark.parametrize(
    ("found", "code", "what", "do"),
    [
        (NOTHING, "no_rclpy", "rclpy is not installed in Python 3.12 (/venv/bin/python)", "pip install '.[ros]'"),
        (replace(NOTHING, python=(3, 13)), "no_rclpy", "Python 3.13", "the wheels are for 3.11 and 3.12"),
        (replace(NOTHING, machine="aarch64"), "no_rclpy", "not installed", "there are no wheels for aarch64"),
        (replace(NOTHING, distribution="jazzy"), "no_rclpy", "ROS 2 (jazzy) is sourced", "--system-site-packages"),
        (
            replace(NOTHING, unsourced=(Path("/opt/ros/jazzy"),)),
            "no_rclpy",
            "installed at /opt/ros/jazzy but not sourced",
            "source /opt/ros/jazzy/setup.bash",
        ),
        (replace(WHEELS, python=(3, 11)), "other_python", "built for Python 3.12, this is Python 3.11", "Python 3.12"),
        (replace(WHEELS, sourced=(Path("/opt/ros/jazzy"),)), "two_ros", "(/opt/ros/jazzy), and its wheels", "shell"),
        (replace(WHEELS, middlewares=()), "no_middleware", "without a middleware", "ros-jazzy-rclpy[fastrtps]"),
        (
            replace(WHEELS, middleware_asked="rmw_cyclonedds_cpp"),
            "middleware_not_there",
            "RMW_IMPLEMENTATION asks for rmw_cyclonedds_cpp, which is not installed here; installed: rmw_fastrtps_cpp",
            "unset RMW_IMPLEMENTATION    or install rmw_cyclonedds_cpp (ros-jazzy-rmw-cyclonedds-cpp)",
        ),
        (
            replace(WHEELS, middleware_asked="rmw_zenoh_cpp", distribution="kilted"),
            "middleware_not_there",
            "RMW_IMPLEMENTATION asks for rmw_zenoh_cpp",
            "install rmw_zenoh_cpp (ros-kilted-rmw-zenoh-cpp)",
        ),
    ],
)
def test_what_does_not_belong_together_is_named_with_the_way_out(found, code, what, do):
    (diagnosis,) = check_installation(found)
    assert (diagnosis.code, diagnosis.severity) == (code, Severity.ERROR)
    assert what in diagnosis.what
    assert do in (diagnosis.fix or "")


@pytest.mark.parametrize(
    ("asked", "there", "taken"),
    [
        (None, ("rmw_cyclonedds_cpp", "rmw_fastrtps_cpp"), "rmw_fastrtps_cpp"),
        (None, ("rmw_cyclonedds_cpp",), "rmw_cyclonedds_cpp"),
        ("rmw_zenoh_cpp", ("rmw_fastrtps_cpp",), "rmw_zenoh_cpp"),
        (None, (), ""),
    ],
)
def test_the_middleware_is_what_ros_would_take(asked, there, taken):
    assert middleware_of(replace(WHEELS, middleware_asked=asked, middlewares=there)) == taken
