import sys

from syncrelay.config import Severity, load_text
from syncrelay.config.interfaces import Field, parse_fields
from tests.config.ament import make_index

FILE = """\
version: 1
groups:
  front:
    policy: exact_time
    topics:
      - {{topic: /a, type: {type}}}
      - {{topic: /b, type: sensor_msgs/msg/Image}}
"""


def notes(type_name, environ, **options):
    return load_text(FILE.format(type=type_name), name="f.yaml", environ=environ, **options).notes


def test_without_an_index_the_file_is_in_order_and_says_what_was_not_checked(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    for environ in ({}, {"AMENT_PREFIX_PATH": ""}, {"AMENT_PREFIX_PATH": str(tmp_path / "none")}):
        (note,) = notes("no_such/msg/Type", environ)
        assert (note.severity, note.code, note.span) == (Severity.NOTE, "not_checked", None)
        assert note.text.startswith("message types were not checked: there is no ament index here")


def test_the_index_of_the_python_environment_counts_without_a_variable(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "prefix", str(make_index(tmp_path)))
    assert notes("sensor_msgs/msg/Imu", {}) == ()
    (note,) = notes("no_such/msg/Type", {})
    assert "is not installed here" in note.text


def test_a_type_without_its_definition_is_a_note_if_its_stamp_matters(environ):
    (note,) = notes("dock_msgs/msg/Opaque", environ)
    assert (note.path, note.severity, note.code) == ("groups.front.topics[0].type", Severity.NOTE, "not_checked")
    text = FILE.format(type="dock_msgs/msg/Opaque, stamp: receive")
    by_trigger = text.replace("exact_time", "latest_time\n    trigger: /b")
    assert load_text(by_trigger, environ=environ).notes == ()


def test_a_package_that_may_come_later_is_a_note(environ):
    (note,) = notes("my_msgs/msg/Mine", environ)
    assert (note.severity, note.code, note.subject) == (Severity.NOTE, "package_missing", "my_msgs")
    assert note.text == "the package `my_msgs` is not installed here, or not sourced"
    (note,) = notes("sensor_msg/msg/Image", environ)
    assert note.text.endswith("not sourced, did you mean `sensor_msgs`?")


def test_transforms_without_the_type_of_tf_are_a_note_that_says_what_to_install(environ):
    text = FILE.format(type="sensor_msgs/msg/Image").replace("policy:", "transforms: {target: base_link}\n    policy:")
    (note,) = load_text(text, environ=environ).notes
    assert (note.path, note.severity, note.code) == ("groups.front.transforms", Severity.NOTE, "transforms_missing")
    assert "tf2_msgs/msg/TFMessage is not installed here" in note.text
    assert "apt-get install ros-jazzy-tf2-msgs" in note.text


def test_a_restamp_is_believed_if_a_type_cannot_be_looked_into(environ):
    text = FILE.format(type="my_msgs/msg/Mine, stamp: receive").replace("sensor_msgs/msg/Image", "std_msgs/msg/String")
    text = text.replace("String}", "String, stamp: receive}").replace(
        "exact_time", "latest_time\n    trigger: /a\n    restamp: latest"
    )
    assert len(load_text(text, environ=environ).notes) == 1


def test_fields_are_read_as_the_interface_definition_says():
    text = """\
        # a comment
        int32 CONSTANT=5
        string NAME = "a # b"
        std_msgs/Header header   # trailing
        Local local
        other/msg/Full full
        float64[9] fixed
        string<=10[<=5] bounded
        string<=10 word "default # 1"  # and more
        int32 number 5
        uint8[] values [1, 2]

    """
    assert parse_fields(text, package="mine") == (
        Field("header", "std_msgs/msg/Header"),
        Field("local", "mine/msg/Local"),
        Field("full", "other/msg/Full"),
        Field("fixed", "float64", array="[9]"),
        Field("bounded", "string", bound="<=10", array="[<=5]"),
        Field("word", "string", bound="<=10", default='"default # 1"'),
        Field("number", "int32", default="5"),
        Field("values", "uint8", array="[]", default="[1, 2]"),
    )
