"""A definition that no message can have costs no time and no traceback: its type counts as unknown."""

import struct

import pytest

from syncrelay.bag.definitions import as_ros2, begins_with_header, converter, fields_of
from syncrelay.bag.payloads import read_ros1_stamp, stamp_reader, value_reader
from syncrelay.bag.recording import Channel, Definition, Encoding
from syncrelay.cdr import LATEST_STAMP
from syncrelay.config import StampField
from syncrelay.errors import BagError
from tests.bag.making import CUSTOM, CUSTOM_TEXT

_TYPE = "rig_msgs/msg/Blip"
_RULE = "\n" + "=" * 80 + "\n"
_HEADER = "std_msgs/Header header\n"


def _channel(text: str, *, encoding: Encoding = Encoding.CDR, form: str = "ros2msg", type_name: str = _TYPE) -> Channel:
    return Channel(1, "/blip", type_name, encoding, Definition(form, text))


def _nested(levels: int, fields: int) -> str:
    parts = [f"MSG: rig_msgs/T{n}\n" + "".join(f"T{n + 1} f{m}\n" for m in range(fields)) for n in range(levels)]
    return _RULE.join([f"{_HEADER}T0 t\nuint32 n\n", *parts, f"MSG: rig_msgs/T{levels}\nuint8 x\n"])


_USELESS = {
    "a type that holds itself": f"{_HEADER}Blip blip\nuint32 n\n",
    "two that hold each other": f"{_HEADER}A a\n{_RULE}MSG: rig_msgs/A\nBlip[] blips\n",
    "one that is not there": f"{_HEADER}rig_msgs/Other other\nuint32 n\n",
    "ten to the twentieth fields": _nested(20, 10),
    "types in types in types": _nested(500, 1),
    "a billion of another": f"{_HEADER}B[1000000000] b\nuint32 n\n{_RULE}MSG: rig_msgs/B\nuint8 x\n",
    "a billion texts": f"{_HEADER}string[1000000000] texts\nuint32 n\n",
    "a constant without an end": f"{_HEADER}float64 X=1e999\nuint32 n\n",
    "no definition": "\0\x1b[31m",
    "more than any text": "uint8 x\n" * 200_000,
}


@pytest.mark.parametrize("text", _USELESS.values(), ids=_USELESS)
@pytest.mark.parametrize(("encoding", "form"), [(Encoding.CDR, "ros2msg"), (Encoding.ROS1, "ros1msg")])
def test_a_definition_of_no_use_leaves_the_type_unknown(text, encoding, form):
    channel = _channel(text, encoding=encoding, form=form)
    assert (fields_of(channel), begins_with_header(channel)) == (None, None)
    assert as_ros2(channel)[1] == ""
    with pytest.raises(BagError, match="does not define"):
        value_reader(channel, "n")
    with pytest.raises(BagError, match="cannot be read"):
        converter(channel)


@pytest.mark.parametrize("text", ["module a { " * 5000, f"struct Blip {{ {'sequence<' * 5000} uint8 x; }};", "\xff"])
def test_an_idl_that_nests_without_end_leaves_the_type_unknown(text):
    assert begins_with_header(_channel(text, form="ros2idl")) is None


def test_a_count_that_lies_in_a_ros1_message_is_not_counted_down():
    poses = _channel(
        f"{_HEADER}Pose[] poses\n{_RULE}MSG: rig_msgs/Pose\nfloat64 x\nfloat64 y\n",
        encoding=Encoding.ROS1,
        form="ros1msg",
    )
    convert = converter(poses)
    header = struct.pack("<IIII", 1, 5, 6, 0)
    whole = convert(header + struct.pack("<Idd", 1, 1.0, 2.0))
    assert whole is not None
    assert struct.unpack_from("<dd", whole, len(whole) - 16) == (1.0, 2.0)
    for count in (2, 20, 2**31, 2**32 - 1):
        assert convert(header + struct.pack("<Idd", count, 1.0, 2.0)) is None


def test_a_count_that_lies_is_not_counted_down_on_the_way_to_a_field():
    text = f"{_HEADER}Pose[] poses\nPose[1000] more\nuint32 n\n{_RULE}MSG: rig_msgs/Pose\nfloat64 x\nfloat64 y\n"
    read = value_reader(_channel(text), "n")
    payload = b"\0\1\0\0" + struct.pack("<iIIxxxx", 5, 6, 1)
    for count in (1, 2**31, 2**32 - 1):
        assert read(payload + struct.pack("<I", count) + bytes(500)) is None


@pytest.mark.parametrize("field", ["number", "label", "header"])
def test_a_stamp_is_read_from_a_time_and_from_nothing_else(field):
    channel = _channel(CUSTOM_TEXT, type_name=CUSTOM)
    assert stamp_reader(StampField(field="seen"), channel) is not None
    with pytest.raises(BagError, match=f"no field {field} to go by: .*expected builtin_interfaces/Time"):
        stamp_reader(StampField(field=field), channel)


def test_a_ros1_stamp_that_ros2_cannot_tell_is_none():
    last = LATEST_STAMP // 10**9
    assert read_ros1_stamp(struct.pack("<III", 1, last, 999_999_999)) == LATEST_STAMP
    assert read_ros1_stamp(struct.pack("<III", 1, last + 1, 0)) is None
