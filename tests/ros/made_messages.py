"""Message packages of the tests' own, built from their definitions as docker/ builds a user's."""

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

_BUILDER = Path(__file__).parents[2] / "docker/build_messages.py"
_PACKAGE = """\
<package format="3">
  <name>{name}</name> <version>0.0.0</version> <description>made</description>
  <maintainer email="tests@example.com">tests</maintainer> <license>Apache-2.0</license>
  {depends}
</package>
"""
_DEPENDS = ("geometry_msgs", "sensor_msgs", "std_msgs", "builtin_interfaces")

PAIR, OWN, HOLDER = "made_sets/msg/Pair", "made_own/msg/Own", "made_own/msg/Holder"
OWN_TEXT = "std_msgs/Header header\nfloat64 value\n"
DEFINITIONS = {
    PAIR: """\
bool flag true
std_msgs/Header header
uint32 number
string[] missing
builtin_interfaces/Time[] stamps
geometry_msgs/Vector3Stamped left
uint8 between 7
geometry_msgs/Vector3Stamped right
geometry_msgs/Quaternion rotation
""",
    OWN: OWN_TEXT,
    HOLDER: "made_own/Own own\ngeometry_msgs/Vector3Stamped left\n",
}
"""What several tests use, which so is built once."""


class MadeMessages:
    """A package that is built: where, and what decodes its messages."""

    def __init__(self, prefix: Path, definitions: Mapping[str, str]) -> None:
        self.prefix = prefix
        self.store = get_typestore(Stores.ROS2_JAZZY)
        for name, text in definitions.items():
            self.store.register(get_types_from_msg(text, name))

    def sourced(self, environment: Mapping[str, str]) -> dict[str, str]:
        """The environment with the package sourced."""
        packages = sysconfig.get_path("purelib", vars={"base": str(self.prefix)})
        added = {
            "AMENT_PREFIX_PATH": self.prefix,
            "LD_LIBRARY_PATH": self.prefix / "lib",
            "PYTHONPATH": packages,
        }
        there = {name: [each for each in environment.get(name, "").split(":") if each] for name in added}
        return {**environment, **{name: ":".join([str(path), *there[name]]) for name, path in added.items()}}

    def decode(self, payload: bytes, name: str) -> Any:
        return self.store.deserialize_cdr(payload, name)


def made(folder: Path, definitions: Mapping[str, str]) -> MadeMessages:
    """Build message types, by their names; once for all processes of the tests that share the folder."""
    if shutil.which("g++") is None:
        pytest.skip("there is no g++, which builds messages")
    pytest.importorskip("rosidl_generator_py", reason="ROS's generators are not installed")
    key = hashlib.sha256(repr(sorted(definitions.items())).encode()).hexdigest()[:12]
    prefix, sources = folder / f"made-{key}", folder / f"sources-{key}"
    with (folder / f"{key}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (prefix / "done").exists():
            packages = {name.split("/")[0] for name in definitions}
            for package in packages:
                depends = "".join(f"<depend>{name}</depend>" for name in _DEPENDS)
                (sources / package / "msg").mkdir(parents=True)
                (sources / package / "package.xml").write_text(_PACKAGE.format(name=package, depends=depends))
            for name, text in definitions.items():
                (sources / f"{name}.msg").write_text(text)
            build(prefix, *(sources / package for package in packages))
            (prefix / "done").touch()
    return MadeMessages(prefix, definitions)


def build(prefix: Path, *folders: Path) -> None:
    """Build packages into a prefix."""
    command = [sys.executable, str(_BUILDER), "--into", str(prefix), *map(str, folders)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=dict(os.environ))
    assert done.returncode == 0, done.stdout + done.stderr
