"""The package that `syncrelay interfaces` writes: colcon builds it, and the consumer of its README gets whole sets."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.stage import Player, Stage
from tests.ros.streams import BEGIN, MS
from tests.workspace.building import Workspace

pytestmark = [pytest.mark.workspace, pytest.mark.ros]

_TOPICS = {"/camera/image": VECTOR, "/lidar/points": VECTOR}
_KEYS = {"policy": "approximate_time", "slop": "20ms", "max_wait": "50ms"}
_INPUTS = [*inputs({"/camera/image": VECTOR}), *inputs({"/lidar/points": VECTOR}, required=False)]


@pytest.fixture(scope="session")
def package(workspace: Workspace) -> Path:
    """The package that is written for a file with one group, built beside syncrelay."""
    file, folder = workspace.folder / "rig.yaml", workspace.folder / "src" / "rig_interfaces"
    file.write_text(config({"front": {**_KEYS, "topics": _INPUTS}}))
    words = ["interfaces", str(file), "-o", str(folder)]
    environment = os.environ | workspace.sourced()
    subprocess.run([workspace.executable, *words], env=environment, check=True, cwd=workspace.folder)
    workspace.colcon("build", "--packages-select", "rig_interfaces")
    return folder


def test_colcon_finds_the_written_package(workspace: Workspace, package: Path):
    assert package.name in workspace.colcon("list", "--names-only").split()


def test_the_consumer_of_the_readme_gets_whole_sets(workspace: Workspace, package: Path, stage: Stage):
    sourced = ["env", *(f"{name}={value}" for name, value in workspace.sourced().items())]
    readme = (package / "README.md").read_text()
    bundle = re.search(r"bundle: (.*)", readme)
    script = re.search(r"```python\n(.*?)```", readme, re.DOTALL)
    assert bundle is not None
    assert script is not None
    file = stage.folder / "rig.yaml"
    text = config({"front": {**_KEYS, "outputs": False, "topics": _INPUTS}})
    file.write_text(text.replace('"outputs"', f'"bundle": {bundle[1]}, "outputs"'))
    (stage.folder / "consumer.py").write_text(script[1])
    stage.start("relay", [*sourced, str(workspace.executable), "--config", str(file)])
    consumer = stage.start("consumer", [*sourced, sys.executable, "-u", str(stage.folder / "consumer.py")])
    player = stage.player(_TOPICS)
    player.is_up()
    _play_until(player, consumer, both=True, said="without []")
    _play_until(player, consumer, both=False, said="without ['lidar_points']")


def _play_until(player: Player, consumer: Process, *, both: bool, said: str) -> None:
    """Play sets, of both topics or of the first, until the consumer has said something of one."""
    numbers = iter(range(1000 * both, 10_000))

    def come() -> bool:
        stamp = BEGIN + (next(numbers) + 20_000 * (not both)) * 100 * MS
        topics = list(_TOPICS)[: 1 + both]
        player.play([Frame(topic, VECTOR, 0, vector(stamp)) for topic in topics])
        return said in consumer.stdout

    wait_until(come, f"{said} of the consumer")
