"""Environments that really have a fault: Python without some packages, Linux with other networks and mounts."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# What syncrelay itself needs, for a Python that is started without its site-packages.
OURS = ("pydantic", "pydantic_core", "annotated_types", "typing_extensions", "typing_inspection", "yaml", "numpy")


def site_with(folder, packages):
    """A folder of links to packages of this Python, to be found by another one."""
    site = folder / "site"
    site.mkdir()
    for package in packages:
        found = importlib.util.find_spec(package)
        assert found is not None
        assert found.origin is not None
        origin = Path(found.origin)
        origin = origin.parent if origin.name.startswith("__init__") else origin
        (site / origin.name).symlink_to(origin)
    return site


def distribution(site, name, version, *requires):
    """The metadata of an installed wheel."""
    folder = site / f"{name.replace('-', '_')}-{version}.dist-info"
    folder.mkdir(parents=True)
    lines = ["Metadata-Version: 2.1", f"Name: {name}", f"Version: {version}"]
    (folder / "METADATA").write_text("\n".join([*lines, *(f"Requires-Dist: {each}" for each in requires)]) + "\n")


def namespaces(*flags):
    """What comes before a command that gets Linux namespaces of its own."""
    program = shutil.which("unshare")
    tried = program and subprocess.run([program, *flags, "true"], capture_output=True, check=False)
    if not tried or tried.returncode:
        pytest.skip("this machine gives no namespaces of its own")
    return [program, *flags]


def unshared(names, script, *words):
    """The command for syncrelay with these namespaces of its own, behind the lines of a shell script as root."""
    if not shutil.which("ip"):
        pytest.skip("this machine has no iproute2")
    command = [sys.executable, "-m", "syncrelay", *words]
    return [*namespaces(*(f"--{name}" for name in names)), "sh", "-ec", f'{script}\nexec "$@"', "sh", *command]
