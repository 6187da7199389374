"""Payloads as columns: each cell is what was drawn, and of damaged payloads what a slow decoder makes of them."""

import random

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from syncrelay.errors import BagError
from syncrelay.recordings.bag.definitions import typestore
from syncrelay.recordings.bag.recording import Definition
from syncrelay.recordings.datasets.decoding import Decoder
from syncrelay.recordings.datasets.message_types import arrow_type
from tests.calls import Calls
from tests.faults.extent import chosen
from tests.recordings.datasets.drawn_messages import LARGE, drawn_messages, drawn_type
from tests.recordings.datasets.reference_decoder import decode
from tests.ros.cdr_messages import STORE

_JAZZY = get_typestore(Stores.ROS2_JAZZY)
_TYPES = chosen(short=45, long=5000)
_PACKAGES = sorted({name.split("/")[0] for name in _JAZZY.fielddefs})


def decoder(store, name, *paths):
    return Decoder(arrow_type(store, name), arrow_type(store, name, paths or None, topic="/topic"))


def test_every_field_of_any_type_has_the_value_that_was_serialized():
    """Types of seed 29, a dozen messages each, in both byte orders; some are missing."""
    messages = large = 0
    for number in range(_TYPES):
        chance = random.Random(f"29 {number}")
        store, name = drawn_type(chance)
        drawn = drawn_messages(store, name, chance, count=12)
        gone = {place for place in range(12) if chance.random() < 0.1}
        column = decoder(store, name).decode([None if n in gone else each for n, each in enumerate(drawn.payloads)])
        column.validate(full=True)
        # As text: a NaN is not equal to itself, and -0.0 is equal to 0.0.
        expected = [None if n in gone else each for n, each in enumerate(drawn.values)]
        assert repr(column.to_pylist()) == repr(expected), (number, store.fielddefs)
        messages += 12 - len(gone)
        large += sum(len(each) > LARGE for each in drawn.payloads)
    assert messages > 9 * _TYPES
    assert large > _TYPES / 6


@pytest.mark.parametrize("package", _PACKAGES)
def test_nothing_of_any_type_of_ros_2_is_lost(package):
    names = [name for name in _JAZZY.fielddefs if name.startswith(f"{package}/")]
    for name in names:
        for number in range(chosen(short=1, long=20)):
            drawn = drawn_messages(_JAZZY, name, random.Random(f"{name} {number}"))
            found = decoder(_JAZZY, name).decode(drawn.payloads).to_pylist()
            assert repr(found) == repr(drawn.values), (name, number)
            assert repr([decode(_JAZZY, name, each) for each in drawn.payloads]) == repr(drawn.values), (name, number)


def test_damaged_messages_are_what_a_slow_decoder_makes_of_each_and_harm_no_other():
    """Types of seed 30: bytes are changed, cut off and added."""
    lost = 0
    for number in range(_TYPES):
        chance = random.Random(f"30 {number}")
        store, name = drawn_type(chance)
        payloads = [_damaged(each, chance) for each in drawn_messages(store, name, chance).payloads]
        expected = [decode(store, name, each) for each in payloads]
        found = decoder(store, name)
        assert repr(found.decode(payloads).to_pylist()) == repr(expected), (number, store.fielddefs)
        assert found.undecodable == expected.count(None)
        lost += found.undecodable
    assert lost > 0.8 * _TYPES


def _damaged(payload: bytes, chance: random.Random) -> bytes:
    content = bytearray(payload)
    match chance.randrange(4):
        case 0:
            del content[chance.randrange(len(content)) :]
        case 1:
            content[chance.randrange(min(len(content), 200))] ^= chance.randrange(1, 256)
        case 2:
            content += bytes(chance.randrange(1, 9))
    return bytes(content)


def test_what_cannot_be_decoded_is_counted():
    found = decoder(STORE, "std_msgs/msg/Header")
    assert found.decode([b"", b"\0\1\0\0", b"\0\7\0\0" + bytes(40), None]).null_count == 4
    assert found.undecodable == 3


def test_a_string_without_its_final_zero_is_read_whole_as_fast_cdr_does():
    payload = bytes.fromhex("00010000 03000000 616200")
    rows = decoder(STORE, "std_msgs/msg/String").decode([payload, payload[:8] + b"abc", payload[:4] + bytes(4)])
    assert rows.to_pylist() == [{"data": "ab"}, {"data": "abc"}, {"data": ""}]


def test_a_length_that_lies_costs_nothing():
    lie = (2**32 - 1).to_bytes(4, "little")
    poses = b"\0\1\0\0" + bytes(8) + b"\1\0\0\0" + bytes(4) + lie + bytes(LARGE)
    transforms = b"\0\1\0\0" + lie + bytes(LARGE)
    for name, payload in {"geometry_msgs/msg/PoseArray": poses, "tf2_msgs/msg/TFMessage": transforms}.items():
        found = decoder(STORE, name)
        with Calls() as calls:
            assert found.decode([payload]).null_count == 1
        assert calls.count < 300


@pytest.mark.parametrize("name", ["sensor_msgs/msg/Imu", "geometry_msgs/msg/PoseArray"])
def test_the_work_does_not_grow_with_messages_or_their_elements(name):
    counts = []
    for number in (10, 1000):
        frames = [f"frame_{'x' * (each % 7)}" for each in range(number)]
        payloads = [_imu(frame) if "Imu" in name else _poses(frame, number // 10) for frame in frames]
        found = decoder(STORE, name)
        with Calls() as calls:
            assert found.decode(payloads).null_count == 0
        counts.append(calls.count)
    # Beside some calls for each payload as a whole.
    assert counts[1] - counts[0] < 15 * 1000


@pytest.mark.parametrize("text", ["wstring name\n", f"made_msgs/Wide wide\n{'=' * 80}\nMSG: made_msgs/Wide\nwstring a"])
def test_a_type_with_wide_strings_is_not_decoded_wrongly(text):
    # Whether a character takes 2 or 4 bytes depends on who serialized it.
    store = typestore("made_msgs/msg/Named", Definition("ros2msg", text))
    assert store is not None
    with pytest.raises(BagError, match=r"^/topic: `\w+` is of type wstring, which cannot be decoded: use --raw$"):
        arrow_type(store, "made_msgs/msg/Named", topic="/topic")


def test_only_the_fields_asked_for_are_given():
    payload = _imu("imu")
    (row,) = decoder(STORE, "sensor_msgs/msg/Imu", "angular_velocity", "header.stamp.sec").decode([payload]).to_pylist()
    assert row == {"header": {"stamp": {"sec": 7}}, "angular_velocity": {"x": 1.0, "y": 2.0, "z": 3.0}}


@pytest.mark.parametrize(
    ("path", "told"),
    [
        ("angular_velocty", "no field `angular_velocty`, did you mean `angular_velocity`?"),
        ("header.stam", "std_msgs/msg/Header has no field `stam`, did you mean `stamp`?"),
        ("header.frame_id.text", "`frame_id` is a value and has no field `text`"),
    ],
)
def test_a_field_that_is_not_there_is_named(path, told):
    with pytest.raises(BagError) as raised:
        decoder(STORE, "sensor_msgs/msg/Imu", path)
    assert told in str(raised.value)


def test_units_stand_beside_the_fields():
    arrow = decoder(STORE, "sensor_msgs/msg/Imu").arrow
    assert arrow.field("angular_velocity").metadata == {b"unit": b"rad/s"}
    assert arrow.field("orientation").metadata is None


def test_a_type_of_ros_2_needs_no_definition_and_an_unknown_one_has_none():
    assert typestore("sensor_msgs/msg/Imu", None) is not None
    assert typestore("rig_msgs/msg/Unheard", None) is None


def _header(frame):
    types = STORE.types
    return types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](sec=7, nanosec=0), frame)


def _imu(frame):
    types = STORE.types
    vector, nine = types["geometry_msgs/msg/Vector3"](x=1.0, y=2.0, z=3.0), np.zeros(9)
    turn = types["geometry_msgs/msg/Quaternion"](x=0, y=0, z=0, w=1)
    imu = types["sensor_msgs/msg/Imu"](_header(frame), turn, nine, vector, nine, vector, nine)
    return bytes(STORE.serialize_cdr(imu, "sensor_msgs/msg/Imu"))


def _poses(frame, count):
    types = STORE.types
    pose = types["geometry_msgs/msg/Pose"](
        types["geometry_msgs/msg/Point"](1, 2, 3), types["geometry_msgs/msg/Quaternion"](x=0, y=0, z=0, w=1)
    )
    poses = types["geometry_msgs/msg/PoseArray"](_header(frame), [pose] * count)
    return bytes(STORE.serialize_cdr(poses, "geometry_msgs/msg/PoseArray"))
