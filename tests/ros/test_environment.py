"""What a user reads where ROS cannot be used, in environments that really lack it: links to this one's packages."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.command import GOOD
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


def _relay(folder: Path, *options: str, **environ: str) -> subprocess.CompletedProcess[str]:
    (folder / "fusion.yaml").write_text(GOOD)
    argv = [sys.executable, *options, "-m", "syncrelay", "--config", str(folder / "fusion.yaml")]
    return subprocess.run(argv, env=environ, capture_output=True, text=True, timeout=120, check=False)


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
def test_what_is_missing_is_named_with_the_ways_to_it(packages, environ, said, tmp_path):
    path = f"{ROOT}:{site_with(tmp_path, packages)}"
    # -S: without the environment's own site-packages, and without the wheels' start-up hook.
    run = _relay(tmp_path, "-S", PYTHONPATH=path, PATH=os.environ["PATH"], **environ)
    assert run.returncode == 69
    assert [words for words in said if words not in run.stderr] == []
    assert "Traceback" not in run.stderr


@pytest.mark.ros
def test_a_middleware_that_is_not_installed_is_named_beside_those_that_are(tmp_path):
    run = _relay(tmp_path, **{**os.environ, "RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"})
    assert run.returncode == 69
    assert "RMW_IMPLEMENTATION asks for rmw_cyclonedds_cpp" in run.stderr
    assert "rmw_fastrtps_cpp" in run.stderr
