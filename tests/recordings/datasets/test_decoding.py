"""Payloads as columns: the values are those that rosbags reads, whatever the type and however the messages differ."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from syncrelay.errors import BagError
from syncrelay.recordings.bag.definitions import typestore
from syncrelay.recordings.datasets import decoding
from syncrelay.recordings.datasets.decoding import Decoder
from syncrelay.recordings.datasets.layouts import Numbers, Repeated, UnfitError, layout_of
from syncrelay.recordings.datasets.message_types import only, type_tree
from tests.recordings.datasets.made_types import made
from tests.ros.cdr_messages import STORE


def decoder(store, name, *paths):
    tree = type_tree(store, name)
    return Decoder(store, only(tree, paths, "/topic") if paths else tree)


def one_by_one(store, name, payloads):
    """The reference: each message by itself with rosbags."""
    single = decoder(store, name)
    return [single._singly([payload]).to_pylist()[0] for payload in payloads]  # noqa: SLF001


@given(made(little_endian=st.booleans()))
def test_every_field_has_the_value_that_was_serialized(drawn):
    column = decoder(drawn.store, drawn.type_name).decode(drawn.payloads)
    column.validate(full=True)
    assert column.to_pylist() == drawn.values


@given(made(most_messages=4))
def test_large_messages_are_decoded_as_small_ones(drawn):
    single = decoder(drawn.store, drawn.type_name)
    assert [single._one(payload).to_pylist()[0] for payload in drawn.payloads] == drawn.values  # noqa: SLF001


@given(made(), st.data())
def test_missing_messages_are_null_where_they_are_missing(drawn, data):
    gone = data.draw(st.sets(st.integers(0, len(drawn.payloads) - 1)))
    payloads = [None if place in gone else payload for place, payload in enumerate(drawn.payloads)]
    expected = [None if place in gone else value for place, value in enumerate(drawn.values)]
    assert decoder(drawn.store, drawn.type_name).decode(payloads).to_pylist() == expected


@given(made(most_messages=6), st.data())
def test_damaged_messages_are_what_rosbags_makes_of_each_and_harm_no_other(drawn, data):
    payloads = list(drawn.payloads)
    for place in data.draw(st.sets(st.integers(0, len(payloads) - 1))):
        payload = bytearray(payloads[place])
        if data.draw(st.booleans()):
            payload = payload[: data.draw(st.integers(0, len(payload)))]
        else:
            payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
        payloads[place] = bytes(payload)
    # A column that only looks damaged is compared as text: a NaN is not equal to itself.
    assert str(decoder(drawn.store, drawn.type_name).decode(payloads).to_pylist()) == str(
        one_by_one(drawn.store, drawn.type_name, payloads)
    )


def test_what_cannot_be_decoded_is_counted():
    found = decoder(STORE, "std_msgs/msg/Header")
    assert found.decode([b"", b"\0\1\0\0", b"\0\7\0\0" + bytes(40), None]).null_count == 4
    assert found.undecodable == 3


def test_a_string_that_is_not_utf_8_is_null_whatever_stands_beside_it():
    header, time = STORE.types["std_msgs/msg/Header"], STORE.types["builtin_interfaces/msg/Time"]
    payloads = [
        bytes(STORE.serialize_cdr(header(time(n, 0), "base"), "std_msgs/msg/Header")).replace(b"base", b"b\xe4se"[:4])
        if n == 3
        else bytes(STORE.serialize_cdr(header(time(n, 0), "base"), "std_msgs/msg/Header"))
        for n in range(8)
    ]
    found = decoder(STORE, "std_msgs/msg/Header")
    assert [row and row["stamp"]["sec"] for row in found.decode(payloads).to_pylist()] == [0, 1, 2, None, 4, 5, 6, 7]
    assert found.undecodable == 1


def test_messages_that_are_alike_are_decoded_at_once(monkeypatch):
    # Else the columns are only as fast as rosbags, and this is what they are for.
    monkeypatch.setattr(decoding.Decoder, "_singly", lambda *_: pytest.fail("one by one"))
    header = STORE.types["std_msgs/msg/Header"]
    time = STORE.types["builtin_interfaces/msg/Time"]
    messages = [
        STORE.serialize_cdr(header(stamp=time(sec=n, nanosec=0), frame_id=frame), "std_msgs/msg/Header")
        for n in range(10)
        for frame in ("base_link", "left_arm_", "map")
    ]
    rows = decoder(STORE, "std_msgs/msg/Header").decode([bytes(each) for each in messages]).to_pylist()
    assert [row["stamp"]["sec"] for row in rows] == [n for n in range(10) for _ in range(3)]
    assert [row["frame_id"] for row in rows[:3]] == ["base_link", "left_arm_", "map"]


def test_elements_of_a_fixed_size_are_not_gone_through_one_by_one():
    poses = STORE.types["geometry_msgs/msg/PoseArray"]
    pose, point, turn = (STORE.types[f"geometry_msgs/msg/{name}"] for name in ("Pose", "Point", "Quaternion"))
    header = STORE.types["std_msgs/msg/Header"](
        stamp=STORE.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2), frame_id="map"
    )
    made_poses = [pose(position=point(x=n, y=0, z=0), orientation=turn(x=0, y=0, z=0, w=1)) for n in range(1000)]
    payload = bytes(STORE.serialize_cdr(poses(header=header, poses=made_poses), "geometry_msgs/msg/PoseArray"))
    layout = layout_of(type_tree(STORE, "geometry_msgs/msg/PoseArray"), payload)
    listed = layout.root.parts[1]
    assert isinstance(listed, Numbers | Repeated)
    assert listed.count == 1000
    (row,) = decoder(STORE, "geometry_msgs/msg/PoseArray").decode([payload]).to_pylist()
    assert [each["position"]["x"] for each in row["poses"]] == list(range(1000))


@pytest.mark.parametrize("length", [0, 1, 2])
def test_bytes_of_any_length_are_decoded_at_once(length, monkeypatch):
    monkeypatch.setattr(decoding.Decoder, "_singly", lambda *_: pytest.fail("one by one"))
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("uint8[] content\nstring text\n", "made_msgs/msg/Packet"))
    packet = store.types["made_msgs/msg/Packet"]
    values = [{"content": bytes([n] * length), "text": "x" * length} for n in range(6)]
    payloads = [
        bytes(
            store.serialize_cdr(packet(np.frombuffer(each["content"], np.uint8), each["text"]), "made_msgs/msg/Packet")
        )
        for each in values
    ]
    assert decoder(store, "made_msgs/msg/Packet").decode(payloads).to_pylist() == values


def test_a_length_that_lies_is_refused_at_once():
    payload = b"\0\1\0\0" + bytes(8) + (2**32 - 1).to_bytes(4, "little") + bytes(20)
    with pytest.raises(UnfitError, match="larger"):
        layout_of(type_tree(STORE, "std_msgs/msg/Header"), payload)


def test_only_the_fields_asked_for_are_given():
    payload = bytes(STORE.serialize_cdr(_imu(), "sensor_msgs/msg/Imu"))
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


def _imu():
    types = STORE.types
    vector, nine = types["geometry_msgs/msg/Vector3"](x=1.0, y=2.0, z=3.0), np.zeros(9)
    header = types["std_msgs/msg/Header"](stamp=types["builtin_interfaces/msg/Time"](sec=7, nanosec=0), frame_id="imu")
    turn = types["geometry_msgs/msg/Quaternion"](x=0, y=0, z=0, w=1)
    return types["sensor_msgs/msg/Imu"](header, turn, nine, vector, nine, vector, nine)
