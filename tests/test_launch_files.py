"""The launch files, checked without launch; where launch is installed, it reads them too."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from syncrelay.config import load

_ROOT = Path(__file__).parents[1]
_FILES = sorted((_ROOT / "launch").glob("*.launch.py"))
_TREES = {path.name: ast.parse(path.read_text(), path.name) for path in _FILES}


def _first_arguments(name: str, *functions: str) -> set[str]:
    """The strings that a launch file passes as the first argument to these functions."""
    calls = [node for node in ast.walk(_TREES[name]) if isinstance(node, ast.Call) and node.args]
    named = [node.args[0] for node in calls if isinstance(node.func, ast.Name) and node.func.id in functions]
    return {node.value for node in named if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def declared(name: str) -> set[str]:
    """The arguments of a launch file."""
    return _first_arguments(name, "DeclareLaunchArgument")


@pytest.mark.parametrize("name", _TREES)
def test_every_argument_that_is_used_is_declared_and_the_other_way_round(name: str):
    assert declared(name) == _first_arguments(name, "LaunchConfiguration", "given")


def test_the_relay_has_the_arguments_that_launch_users_expect():
    assert declared("relay.launch.py") >= {"config", "namespace", "log_level", "use_sim_time", "respawn"}


def test_a_group_gets_arguments_that_the_relay_has():
    passed = [node for node in ast.walk(_TREES["groups.launch.py"]) if isinstance(node, ast.Dict)]
    assert {key.value for node in passed for key in node.keys if isinstance(key, ast.Constant)} == {
        "config",
        "group",
        "node_name",
    }
    assert declared("relay.launch.py") >= {"config", "group", "node_name"}


def test_the_relay_is_started_with_options_that_it_has():
    words = [node.value for node in ast.walk(_TREES["relay.launch.py"]) if isinstance(node, ast.Constant)]
    options = {word for word in words if isinstance(word, str) and word.startswith("--")}
    argv = [sys.executable, "-m", "syncrelay", "--help"]
    told = subprocess.run(argv, capture_output=True, text=True, check=True).stdout
    assert options == {"--config", "--group", "--log-level"}
    assert all(option in told for option in options)


def _groups():
    """Return the function of groups.launch.py that reads the file; it does not need launch."""
    kept = [node for node in _TREES["groups.launch.py"].body if getattr(node, "name", None) == "_groups"]
    names = {"Path": Path, "re": re, "yaml": yaml}
    exec(compile(ast.Module(kept, []), "groups.launch.py", "exec"), names)  # noqa: S102  it is ours
    return names["_groups"]


@pytest.mark.parametrize("path", sorted((_ROOT / "configs").glob("*.yaml")), ids=lambda path: path.name)
def test_each_group_of_a_file_is_found(path: Path):
    assert _groups()(str(path)) == [group.name for group in load(str(path)).groups]


@pytest.mark.parametrize("key", ["on", "NO", "null_", "_1e3"])
def test_the_name_of_a_group_is_what_is_written(key: str, tmp_path: Path):
    topics = "[{topic: /a, type: sensor_msgs/msg/Image}, {topic: /b, type: sensor_msgs/msg/Image}]"
    path = tmp_path / "fusion.yaml"
    path.write_text(f"version: 1\ngroups: {{{key}: {{policy: exact_time, topics: {topics}}}}}\n")
    assert _groups()(str(path)) == [group.name for group in load(str(path)).groups] == [key]


@pytest.mark.parametrize("text", ["", "[]", "groups:", "groups: {}", "groups: [front]"])
def test_a_file_without_groups_starts_nothing(text: str, tmp_path: Path):
    path = tmp_path / "fusion.yaml"
    path.write_text(text)
    with pytest.raises(RuntimeError, match="no groups found"):
        _groups()(str(path))


@pytest.mark.parametrize(
    "text",
    [
        "groups: {a: {}, b: {}}",
        "metrics: null\ngroups: {a: {}, b: {}}",
        "metrics: {hosts: [robot]}\ngroups: {a: {}, b: {}}",
        "metrics: {listen: '127.0.0.1:9464'}\ngroups: {a: {}}",
        "metrics: {listen: '127.0.0.1:0'}\ngroups: {a: {}, b: {}}",
    ],
)
def test_each_relay_has_a_port_where_the_file_leaves_it_one(text: str, tmp_path: Path):
    path = tmp_path / "fusion.yaml"
    path.write_text(text)
    assert _groups()(str(path))


def test_one_port_is_not_given_to_several_relays(tmp_path: Path):
    path = tmp_path / "fusion.yaml"
    path.write_text("metrics: {listen: '127.0.0.1:9464'}\ngroups: {a: {}, b: {}}")
    with pytest.raises(RuntimeError, match=r"metrics\.listen names one port for 2 processes"):
        _groups()(str(path))


@pytest.mark.parametrize("path", _FILES, ids=lambda path: path.name)
def test_launch_reads_it(path: Path):
    pytest.importorskip("launch_ros.actions")
    launch = pytest.importorskip("launch.launch_description_sources")
    description = launch.get_launch_description_from_python_launch_file(str(path))
    assert {argument.name for argument in description.get_launch_arguments()} == declared(path.name)
