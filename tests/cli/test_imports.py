"""What the commands import: each what it needs, which decides how soon it starts."""

import json

import pytest

from syncrelay.cli.commands import COMMANDS
from tests.cli.command import GOOD, run_python

# What only other commands need: packages, and the parts of ours that they are for.
_OF_OTHERS = {
    *("argcomplete", "jinja2", "lz4", "mcap", "rich", "rosbags", "ruamel"),
    *("textual", "zstandard", "syncrelay.recordings", "syncrelay.doctor", "syncrelay.rig", "syncrelay.top"),
    "syncrelay.status.document",
}
_OF_THE_RELAY = {
    "numpy",
    "rclpy",
    "std_msgs",
    "waitress",
    "syncrelay.explain",
    "syncrelay.relay",
    "syncrelay.ros",
    "syncrelay.status",
}
_OF_FILES = {"pydantic", "yaml", "syncrelay.config"}
_SCRIPT = """
import json, sys
from syncrelay.cli import main
for words in json.loads(sys.argv[1]):
    main(words)
print(json.dumps(list(sys.modules)))
"""


def imported(*commands, folder):
    """What one process has imported by the end of these commands: modules, and parts of packages."""
    (folder / "f.yaml").write_text(GOOD)
    done = run_python("-c", _SCRIPT, json.dumps(commands), folder=folder)
    names = json.loads(done.stdout.splitlines()[-1])
    return {".".join(name.split(".")[:length]) for name in names for length in (1, 2, 3)}, done.stderr


def test_help_and_wrong_usage_need_nothing_that_the_command_needs(tmp_path):
    commands = [["--help"], ["validate"], *([name, "--help"] for name in COMMANDS if name != "completion")]
    found, told = imported(*commands, folder=tmp_path)
    assert "syncrelay validate --help" in told
    assert found & (_OF_OTHERS | _OF_THE_RELAY | _OF_FILES) == set()


def test_files_are_checked_and_described_with_what_reads_files_alone(tmp_path):
    found, told = imported(["validate", "f.yaml"], ["schema"], folder=tmp_path)
    assert told == ""
    assert found >= _OF_FILES
    assert found & (_OF_OTHERS | _OF_THE_RELAY) == set()


def test_the_demos_file_is_shown_without_ros(tmp_path):
    found, _ = imported(["demo", "--show-config"], folder=tmp_path)
    assert found & {"rclpy", "std_msgs"} == set()


@pytest.mark.ros
def test_the_relay_imports_nothing_that_only_other_commands_need(tmp_path):
    # All that it imports is there when ROS refuses the argument, before there is a node.
    found, told = imported(["--config", "f.yaml", "--ros-args", "--nonsense"], folder=tmp_path)
    assert "--nonsense" in told
    assert found >= _OF_THE_RELAY
    assert found & _OF_OTHERS == set()


@pytest.mark.ros
def test_types_of_messages_are_used_without_what_generates_them(tmp_path):
    script = (
        "import sys; from syncrelay.ros.environment import require_rclpy; require_rclpy();"
        "from std_srvs.srv import Trigger; Trigger.__class__.__import_type_support__();"
        "print('rosidl_generator_py' in sys.modules, *sys.modules.keys() & {'em', 'lark'});"
        "from rosidl_generator_py import generate_py_impl; print(generate_py_impl.generate_py.__name__)"
    )
    assert run_python("-c", script, folder=tmp_path).stdout == "True\ngenerate_py\n"
