"""A colcon workspace with this repository in it, and the environment that its setup files make."""

import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
COLCON = "SYNCRELAY_COLCON"
"""Names the venv that holds colcon and ament_cmake, in the place of a ROS installation that is sourced."""


class Workspace:
    """A folder with src/, and after `colcon build` with install/. The path of the active venv has a space."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.venv = folder.parent / "a venv"
        self.venv.symlink_to(sys.prefix)
        self.sources = folder / "src" / "syncrelay"
        self.prefix = folder / "install" / "syncrelay"
        self.executable = self.prefix / "lib" / "syncrelay" / "syncrelay"
        python = f"python{sys.version_info.major}.{sys.version_info.minor}"
        self.packages = self.prefix / "lib" / python / "site-packages"

    def colcon(self, *words: str) -> str:
        """Run colcon as with ROS sourced and the tests' venv active; return what it prints."""
        ros = Path(os.environ[COLCON]).resolve()
        environment = _without_ours(os.environ) | {
            "PATH": os.pathsep.join([str(self.venv / "bin"), str(ros / "bin"), os.environ["PATH"]]),
            "VIRTUAL_ENV": str(self.venv),
            "CMAKE_PREFIX_PATH": str(ros),
            "AMENT_PREFIX_PATH": str(ros),
            "PYTHONPATH": sysconfig.get_path("purelib", vars={"base": str(ros)}),
        }
        done = subprocess.run(
            [ros / "bin" / "colcon", "--log-base", "log", *words],
            cwd=self.folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
        return done.stdout

    def sourced(self) -> dict[str, str]:
        """The variables that `source install/local_setup.bash` sets or changes."""
        before = _without_ours(os.environ)
        listed = subprocess.run(
            ["bash", "-c", ". install/local_setup.bash && env --null"],  # noqa: S607  the user's
            cwd=self.folder,
            env=before,
            capture_output=True,
            text=True,
            check=True,
        )
        after = dict(each.split("=", 1) for each in listed.stdout.split("\0") if each)
        return {
            name: value for name, value in after.items() if before.get(name) != value and name not in ("_", "SHLVL")
        }


def build(folder: Path) -> Workspace:
    """Clone what is tracked into a new workspace, and build it."""
    workspace = Workspace(folder)
    tracked = subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT, text=True)  # noqa: S607  the user's
    # The compiled path is what `pip install -e` leaves in the clone.
    built = [str(path.relative_to(ROOT)) for path in ROOT.glob("syncrelay/ros/compiled/*.so")]
    for name in filter(None, [*tracked.split("\0"), *built]):
        (workspace.sources / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, workspace.sources / name)
    workspace.colcon("build")
    return workspace


def _without_ours(environment: Mapping[str, str]) -> dict[str, str]:
    """The environment without the variables that lead to this checkout."""
    return {name: value for name, value in environment.items() if name not in ("PYTHONPATH", COLCON)}
