"""package.xml agrees with pyproject.toml."""

import ast
import re
import tomllib
from pathlib import Path
from xml.etree import ElementTree as ET

_ROOT = Path(__file__).parents[1]
_PACKAGE = ET.parse(_ROOT / "package.xml").getroot()  # noqa: S314  a file of ours
_PROJECT = tomllib.loads((_ROOT / "pyproject.toml").read_text())["project"]
_NEEDED = {each.text or "" for each in _PACKAGE.findall("exec_depend")}
# Dependencies that rosdep does not name python3-NAME.
_KEYS = {"pyyaml": "python3-yaml"}
_OF_ROS = re.compile(r"rclpy|ament_index_python|launch(_ros)?|\w+_(msgs|srvs|interfaces)")


def test_both_say_the_same_of_the_package():
    said = {name: _PACKAGE.findtext(name) for name in ("name", "version", "description", "license")}
    assert said == {name: _PROJECT[name] for name in said}


def test_every_dependency_is_a_key_of_rosdep_or_named_where_a_workspace_is_explained():
    names = [re.split(r"[^\w.-]", each)[0].lower() for each in _PROJECT["dependencies"]]
    keys = {name: _KEYS.get(name, f"python3-{name}") for name in names}
    page = (_ROOT / "docs" / "howto" / "workspace.md").read_text().lower()
    from_pip = [name for name in names if keys[name] not in _NEEDED]
    assert [name for name in from_pip if f"`{name}`" not in page] == []
    assert {key for key in _NEEDED if key.startswith("python3-")} <= set(keys.values())


def test_every_package_of_ros_that_is_imported_is_needed():
    sources = [*(_ROOT / "syncrelay").rglob("*.py"), *(_ROOT / "launch").glob("*.py")]
    imported = {name for path in sources for name in _imported(path) if _OF_ROS.fullmatch(name)}
    assert {name for name in _NEEDED if not name.startswith("python3-")} >= imported
    assert imported >= {"rclpy", "launch_ros", "diagnostic_msgs"}


def _imported(path: Path) -> set[str]:
    nodes = list(ast.walk(ast.parse(path.read_text())))
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module]
    return {name.partition(".")[0] for name in names}
