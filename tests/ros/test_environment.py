"""What a user reads where ROS cannot be used, in environments that really lack it: links to this one's packages."""

import os
import subprocess
import sys

import pytest

from tests.doctor.environments import OURS, ROOT, site_with

_RCLPY = [
    "rclpy",
    "rpyutils",
    "ament_index_python",
    "builtin_interfaces",
    "rcl_interfaces",
    "rosidl_parser",
    "rosidl_pycommon",
]

_FILE = """\
version: 1
groups:
  front:
    policy: exact_time
    topics:
      - {topic: /a, type: sensor_msgs/msg/Imu}
      - {topic: /b, type: sensor_msgs/msg/Imu}
"""


@pytest.fixture
def relay_with(tmp_path):
    """Run the relay where only the packages named are to be found, and give the finished process."""

    def run(packages, **environ):
        site = site_with(tmp_path, packages)
        (tmp_path / "fusion.yaml").write_text(_FILE)
        # -S: without the environment's own site-packages, and without the wheels' start-up hook.
        return subprocess.run(
            [sys.executable, "-S", "-m", "syncrelay", "--config", tmp_path / "fusion.yaml"],
            env={"PYTHONPATH": f"{ROOT}:{site}", "PATH": os.environ["PATH"], **environ},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )

    return run


@pytest.mark.parametrize(
    ("packages", "environ", "said"),
    [
        (OURS, {}, ["rclpy is not installed", "pip install '.[ros]'", "source /opt/ros"]),
        (OURS, {"ROS_DISTRO": "jazzy"}, ["ROS 2 jazzy is sourced, but Python", "--system-site-packages"]),
        pytest.param(
            [*OURS, *_RCLPY],
            {},
            ["rclpy is installed but cannot be imported: lib", "middleware"],
            marks=pytest.mark.ros,
        ),
    ],
    ids=["no rclpy", "a ROS for another Python", "no middleware"],
)
def test_what_is_missing_is_named_with_the_ways_to_it(relay_with, packages, environ, said):
    run = relay_with(packages, **environ)
    assert run.returncode == 69
    assert [words for words in said if words not in run.stderr] == []
    assert "Traceback" not in run.stderr


@pytest.mark.ros
def test_a_middleware_that_is_not_installed_is_named_beside_those_that_are(tmp_path):
    (tmp_path / "fusion.yaml").write_text(_FILE)
    run = subprocess.run(
        [sys.executable, "-m", "syncrelay", "--config", tmp_path / "fusion.yaml"],
        env={**os.environ, "RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 69
    assert "RMW_IMPLEMENTATION asks for rmw_cyclonedds_cpp" in run.stderr
    assert "rmw_fastrtps_cpp" in run.stderr
