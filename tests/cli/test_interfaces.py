"""`syncrelay interfaces`: the messages of a file's groups, and that `bundle` finds what they hold."""

import json
import re

import pytest
from rosbags.typesys import get_types_from_msg

from syncrelay.config import load, load_text
from syncrelay.config.message_package import messages_of, package_of
from tests.cli.command import run_here
from tests.config.ament import INTERFACES, write_index
from tests.ros.configs import config, inputs

IMAGE, IMU = "sensor_msgs/msg/Image", "sensor_msgs/msg/Imu"
_STEREO = {"/camera/left/image": IMAGE, "/camera/right/image": IMAGE, "/imu": IMU}


def _group(topics, **keys):
    return {"policy": "exact_time", "topics": inputs(topics), **keys}


def _messages(groups, package="rig_interfaces"):
    return messages_of(load_text(config(groups), environ={}), package)


def test_the_written_files_are_a_package_whose_messages_hold_the_groups(tmp_path):
    groups = {"front": _group(_STEREO), "arm_tool": _group({"/tool/imu": IMU, "/class": IMU})}
    (tmp_path / "fusion.yaml").write_text(config(groups))
    done = run_here("interfaces", "fusion.yaml", folder=tmp_path)
    assert done.returncode == 0
    assert (
        done.stderr
        == "syncrelay: wrote fusion_interfaces: fusion_interfaces/msg/FrontSet, fusion_interfaces/msg/ArmToolSet\n"
    )
    folder = tmp_path / "fusion_interfaces"
    files = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    assert files == ["CMakeLists.txt", "README.md", "msg/ArmToolSet.msg", "msg/FrontSet.msg", "package.xml"]
    head = ["header", "number", "missing", "stamps"]
    fields = {name: [field for field, _ in _parsed(folder, name)] for name in ("FrontSet", "ArmToolSet")}
    assert fields == {
        "FrontSet": [*head, "camera_left_image", "camera_right_image", "imu"],
        "ArmToolSet": [*head, "tool_imu", "input_class"],
    }
    # What the README says to write is a file in order, where the package is installed, and every input has its field.
    definitions = {f"fusion_interfaces/msg/{name}": (folder / f"msg/{name}.msg").read_text() for name in fields}
    environ = {"AMENT_PREFIX_PATH": str(write_index(tmp_path / "ament", {**INTERFACES, **definitions}))}
    bundles = re.findall(r"^    bundle: (.*)$", (folder / "README.md").read_text(), re.MULTILINE)
    text = config({name: {**keys, "bundle": name} for name, keys in groups.items()})
    for name, bundle in zip(groups, bundles, strict=True):
        text = text.replace(json.dumps({"bundle": name})[1:-1], f'"bundle": {bundle}')
    (tmp_path / "with.yaml").write_text(text)
    found = load(str(tmp_path / "with.yaml"), environ=environ)
    assert [group.bundle and group.bundle.type for group in found.groups] == [*definitions]
    assert found.notes == ()


def _parsed(folder, name):
    ((_, fields),) = get_types_from_msg((folder / f"msg/{name}.msg").read_text(), f"rig/msg/{name}").values()
    return fields


def test_bundles_that_are_in_the_file_already_name_the_package_the_messages_and_the_fields():
    bundle = {"topic": "/set", "type": "rig_msgs/msg/Stereo", "fields": {"port": "/camera/left/image"}}
    groups = {"front": _group(_STEREO, bundle=bundle)}
    assert package_of(load_text(config(groups), environ={}), "fusion") == "rig_msgs"
    (message,) = _messages(groups, "rig_msgs")
    assert (message.name, message.topic) == ("Stereo", "/set")
    assert [field for field, _, _ in message.fields] == ["port", "camera_right_image", "imu"]
    assert message.named == {}


@pytest.mark.parametrize(
    ("stem", "package"), [("Fusion-2", "fusion_2_interfaces"), ("7", "sets_7_interfaces"), ("-", "sets_interfaces")]
)
def test_a_package_is_named_after_the_file(stem, package):
    assert package_of(load_text(config({"front": _group(_STEREO)}), environ={}), stem) == package


@pytest.mark.parametrize(
    ("groups", "why"),
    [
        (
            {"a_b": _group(_STEREO), "aB": _group(_STEREO, output_prefix="/z")},
            "the groups a_b and aB would have one message, ABSet: write the `type` of a `bundle`",
        ),
        (
            {"front": {"policy": "exact_time", "topics": [{"topic": "/a"}, {"topic": "/b", "type": IMU}]}},
            "front: write the `type` of /a: a field of the message has it",
        ),
    ],
)
def test_what_has_no_message_is_refused(tmp_path, groups, why):
    (tmp_path / "fusion.yaml").write_text(config(groups))
    done = run_here("interfaces", "fusion.yaml", folder=tmp_path)
    assert (done.returncode, done.stderr.strip().removeprefix("syncrelay: ")) == (2, why)
    assert [path.name for path in tmp_path.iterdir()] == ["fusion.yaml"]


def test_a_folder_that_is_there_is_not_overwritten(tmp_path):
    (tmp_path / "fusion.yaml").write_text(config({"front": _group(_STEREO)}))
    (tmp_path / "there").mkdir()
    done = run_here("interfaces", "fusion.yaml", "-o", "there", folder=tmp_path)
    assert done.returncode == 1
    assert "already exists" in done.stderr
