"""syncrelay in a colcon workspace: colcon builds it, and `ros2 run` and launch find it.

Neither ros2cli nor launch can be installed here: what they look for is checked, and what they start is started.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import pytest

from syncrelay.rig.schedule import SENSORS
from tests.ros.processes import Process
from tests.ros.stage import Collector, Stage
from tests.ros.summary import read_summary
from tests.workspace.building import Workspace

pytestmark = [pytest.mark.workspace, pytest.mark.ros]

_OUTPUTS = {
    "/camera_lidar/demo/camera/image_raw": "sensor_msgs/msg/Image",
    "/camera_lidar/demo/lidar/points": "sensor_msgs/msg/PointCloud2",
    "/lidar_imu/demo/imu/data": "sensor_msgs/msg/Imu",
}


def test_colcon_finds_one_package_in_the_clone(workspace: Workspace):
    assert workspace.colcon("list", "--names-only", "--base-paths", "src/syncrelay").split() == ["syncrelay"]


def test_no_package_below_the_clone_would_be_built_by_itself(workspace: Workspace):
    assert workspace.colcon("list", "--base-paths", "src/syncrelay/tests", "src/syncrelay/docker") == ""


def test_all_of_the_package_is_installed_with_what_it_reads(workspace: Workspace):
    sources = workspace.sources / "syncrelay"
    kept = {path.relative_to(sources) for path in sources.rglob("*") if path.is_file()}
    installed = workspace.packages / "syncrelay"
    assert {path.relative_to(installed) for path in installed.rglob("*") if path.suffix not in ("", ".pyc")} >= {
        path for path in kept if path.suffix
    }
    assert {path.suffix for path in kept} >= {".py", ".yaml", ".tcss", ".xml", ".jinja", ".js", ".css"}


@pytest.mark.parametrize("folder", ["configs", "launch"])
def test_examples_and_launch_files_are_shared(workspace: Workspace, folder: str):
    shared = workspace.prefix / "share" / "syncrelay" / folder
    assert {path.name for path in shared.iterdir()} == {path.name for path in (workspace.sources / folder).iterdir()}


# As `ros2 run`, `ros2 launch` and launch_ros' Node look for them.
_FOUND = """
import os
from ament_index_python.packages import get_package_prefix, get_package_share_directory
import syncrelay
executable = os.path.join(get_package_prefix("syncrelay"), "lib", "syncrelay", "syncrelay")
print(executable, os.access(executable, os.X_OK))
print(os.path.exists(os.path.join(get_package_share_directory("syncrelay"), "launch", "relay.launch.py")))
print(os.path.exists(os.path.join(get_package_share_directory("syncrelay"), "package.xml")))
print(syncrelay.__file__)
"""


def test_it_is_found_where_the_workspace_is_sourced(workspace: Workspace, tmp_path: Path):
    environment = os.environ | workspace.sourced()
    found = subprocess.check_output([sys.executable, "-c", _FOUND], env=environment, text=True, cwd=tmp_path)
    package = workspace.packages / "syncrelay" / "__init__.py"
    assert found.splitlines() == [f"{workspace.executable} True", "True", "True", str(package)]


def test_what_a_build_with_links_would_link_to_can_be_executed(workspace: Workspace):
    # A build with links takes a minute: CMake makes each link by a script.
    assert os.access(workspace.folder / "build" / "syncrelay" / "bin" / "syncrelay", os.X_OK)


def test_the_installed_executable_says_its_version(workspace: Workspace, tmp_path: Path):
    environment = os.environ | workspace.sourced()
    said = subprocess.check_output([workspace.executable, "--version"], env=environment, text=True, cwd=tmp_path)
    assert said == f"syncrelay {version('syncrelay')}\n"


def test_the_installed_executable_relays_the_demos_rig_and_is_reloaded_by_a_service_meanwhile(
    workspace: Workspace, stage: Stage
):
    config = stage.folder / "rig.yaml"
    shutil.copy(workspace.packages / "syncrelay" / "cli" / "demo.yaml", config)
    relay = _start(workspace, stage, "--config", str(config), "--ros-args", "-r", "__node:=syncrelay_demo")
    collector = stage.collector(_OUTPUTS, reliability="best_effort")
    _start_sensors(stage)
    _wait_for_sets(collector, 20)
    caller = stage.caller("/syncrelay_demo")
    config.write_text(config.read_text().replace("slop: 8ms", "slop: 9ms"))
    assert caller.call("reload") == (True, "reloaded: 1 group unchanged; rebuilt lidar_imu")
    so_far = {output: collector.count(output) for output in _OUTPUTS}
    for output, count in so_far.items():
        collector.wait_for(output, count + 20)
    # As with launch, where the terminal may send another.
    relay.send(signal.SIGINT)
    relay.send(signal.SIGINT)
    assert relay.wait() == 0
    summary = read_summary(relay.stderr)
    assert all(summary[group].sets >= 20 for group in ("camera_lidar", "lidar_imu"))


def _start(workspace: Workspace, stage: Stage, *arguments: str) -> Process:
    """Start the installed executable in a shell where the workspace is sourced."""
    variables = [f"{name}={value}" for name, value in workspace.sourced().items()]
    return stage.start("relay", ["env", *variables, str(workspace.executable), *arguments])


def _start_sensors(stage: Stage) -> None:
    start = time.time_ns()
    for name in SENSORS:
        words = [name, "--seed=0", f"--start={start}", "--until-stdin-ends"]
        stage.start(name, [sys.executable, "-m", "syncrelay.ros.sensor", *words], stdin=subprocess.PIPE)


def _wait_for_sets(collector: Collector, count: int) -> None:
    for output in _OUTPUTS:
        collector.wait_for(output, count)
