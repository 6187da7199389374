"""Messages put together from serialized ones, against what rosbags serializes, and by bytes written out by hand."""

import random
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from syncrelay.cdr_assembly import Assembler, UnfitError
from syncrelay.cdr_walk import UnreadableFieldError
from syncrelay.recordings.bag.definitions import fields_in
from tests.calls import Calls
from tests.faults.extent import chosen
from tests.recordings.datasets.drawn_messages import drawn_message, drawn_set
from tests.ros.cdr_messages import with_stamp

_TYPES = {
    "a/Set": {"number": "uint8", "box": "a/Box", "level": "a/Level", "note": "string"},
    "a/Box": {"stamp": "uint32", "width": "double", "name": "string"},
    "a/Level": {"low": "uint16"},
}
_DEFAULT = bytes.fromhex(
    "00 01 00 00"  # encapsulation: CDR_LE
    "05 00 00 00"  # number, and up to the uint32
    "00 00 00 00"  # box.stamp, which ends where a double may stand
    "00 00 00 00 00 00 00 00"  # box.width
    "01 00 00 00 00"  # box.name, empty
    "00"  # up to the uint16
    "07 00"  # level.low
    "01 00 00 00 00"  # note, empty
)
_BOX = bytes.fromhex(
    "00 01 00 00"  # encapsulation
    "11 22 33 44"  # stamp
    "00 00 00 00"  # up to the double
    "00 00 00 00 00 00 f0 3f"  # width: 1.0
    "03 00 00 00  61 62 00"  # name: `ab`
)


def _assembler() -> Assembler:
    return Assembler(_TYPES.__getitem__, "a/Set", _DEFAULT)


@pytest.mark.parametrize(
    ("payload", "why"),
    [
        (_BOX[:-1], "box is cut off, or of another type"),
        (_BOX[:3], "box is not plain CDR"),
        (b"\0\x02" + _BOX[2:], "box is not plain CDR"),
        (_BOX[:20] + b"\xff\xff\xff\xff" + _BOX[24:], "box is cut off, or of another type"),
    ],
)
def test_what_is_no_message_of_the_fields_type_is_refused(payload, why):
    with pytest.raises(UnfitError) as refused:
        _assembler().assemble({"box": payload})
    assert str(refused.value) == why


def test_too_many_values_in_the_other_byte_order_are_refused():
    types = {"a/Set": {"path": "a/Path"}, "a/Path": {"points": "sequence<a/Point>"}, "a/Point": {"x": "double"}}
    assembler = Assembler(types.__getitem__, "a/Set", b"\0\1\0\0" + bytes(4))

    def in_order(order: str, count: int) -> bytes:
        return struct.pack(f"{order}I4x{count}d", count, *range(count))

    assert assembler.assemble({"path": b"\0\0\0\0" + in_order(">", 9_999)})[4:] == in_order("<", 9_999)
    with pytest.raises(UnfitError, match="path has more than 20000 values to be put in other places"):
        assembler.assemble({"path": b"\0\0\0\0" + in_order(">", 10_000)})


@given(st.binary(max_size=60), st.sampled_from([0, 1, 6, 7]))
def test_any_bytes_are_a_field_or_refused(body, kind):
    try:
        assembled = _assembler().assemble({"box": bytes([0, kind, 0, 0]) + body})
    except UnfitError:
        return
    assert assembled.endswith(_DEFAULT[-5:])


def test_messages_of_one_size_whose_lengths_differ_are_cut_where_they_say():
    types = {"a/Set": {"names": "a/Names", "low": "uint16"}, "a/Names": {"one": "string", "other": "sequence<uint16>"}}
    assembler = Assembler(types.__getitem__, "a/Set", b"\0\1\0\0" + struct.pack("<I4sIH", 1, b"", 0, 7))

    def names(one: bytes, count: int) -> bytes:
        padding = bytes(-len(one) % 4)
        body = struct.pack("<I", len(one)) + one + padding + struct.pack(f"<I{count}H", count, *range(count))
        return body + bytes(24 - len(body))

    for one, count in 2 * [(b"abc\0", 2), (b"a\0", 1), (b"abcdefg\0", 3), (b"a\0", 4)]:
        payload = names(one, count)
        assembled = assembler.assemble({"names": b"\0\1\0\0" + payload})
        end = 4 + len(one) + -len(one) % 4 + 4 + 2 * count
        assert assembled == b"\0\1\0\0" + payload[:end] + b"\x07\0"


def test_a_type_with_a_wstring_is_refused():
    with pytest.raises(UnreadableFieldError, match="wstring has no plain layout"):
        Assembler({"a/Set": {"text": "wstring"}}.__getitem__, "a/Set", _DEFAULT)


def test_a_long_array_of_elements_of_one_size_is_passed_at_once():
    types = {"a/Set": {"number": "uint8", "points": "a/Points"}, "a/Points": {"all": "sequence<a/Point>"}}
    types["a/Point"] = {"kind": "uint8", "x": "double"}
    first, others = struct.pack("<IB3xd", 100_000, 1, 2.5), struct.pack("<B7xd", 1, 2.5) * 99_999
    assembler = Assembler(types.__getitem__, "a/Set", b"\0\1\0\0" + bytes(8))
    # Behind the number the first point begins at 8: its own padding changes, that of the others does not.
    whole = struct.pack("<B3xIB7xd", 0, 100_000, 1, 2.5) + others
    with Calls() as calls:
        assert assembler.assemble({"points": b"\0\1\0\0" + first + others}) == b"\0\1\0\0" + whole
    assert calls.count < 200


def test_stamps_are_replaced_where_fields_begin_with_a_header_wherever_these_stand():
    store = get_typestore(Stores.ROS2_JAZZY)
    text = "uint8 first\nsensor_msgs/Image image\nbool second\nsensor_msgs/Imu imu\n"
    store.register(get_types_from_msg(text, "made_msgs/msg/Set"))
    chance, stamp = random.Random(4), 1_700_000_000_123_456_789
    default = bytes(store.serialize_cdr(drawn_message(store, "made_msgs/msg/Set", chance), "made_msgs/msg/Set"))
    assembler = Assembler(fields_in(store), "made_msgs/Set", default)
    types = {"image": "sensor_msgs/msg/Image", "imu": "sensor_msgs/msg/Imu"}
    for _ in range(20):
        contents = {
            field: bytes(store.serialize_cdr(drawn_message(store, each, chance), each)) for field, each in types.items()
        }
        for stamped in (["image"], ["imu"], ["imu", "image"]):
            expected = {field: with_stamp(each, stamp) for field, each in contents.items() if field in stamped}
            assembled = assembler.assemble(contents, stamp=stamp, stamped=stamped)
            assert assembled == assembler.assemble(contents | expected)
            assert assembled != assembler.assemble(contents)


def test_drawn_types_and_messages_are_byte_for_byte_what_is_serialized():
    """Drawn: messages of up to four levels, of whose fields any that is a message may be given."""
    chance = random.Random(32)
    n_given = n_left = 0
    n_drawn = chosen(short=200, long=1000)
    for number in range(n_drawn):
        store, name = drawn_set(chance)
        expected, whole = drawn_message(store, name, chance), drawn_message(store, name, chance)
        assembler = Assembler(fields_in(store), "made_msgs/Set", bytes(store.serialize_cdr(expected, name)))
        members = {field: kind[1] for field, kind in store.fielddefs[name][1] if kind[0] == Nodetype.NAME}
        contents = {}
        for field, type_name in members.items():
            if chance.random() < 0.8:
                message, is_little = getattr(whole, field), chance.random() < 0.7
                padding = chance.randbytes(chance.choice((0, 0, 1, 3, 8)))
                contents[field] = bytes(store.serialize_cdr(message, type_name, little_endian=is_little)) + padding
                setattr(expected, field, message)
        serialized = bytes(store.serialize_cdr(expected, name))
        # Again after others: what was kept of one message must not be taken for another's.
        others = {
            field: bytes(store.serialize_cdr(getattr(drawn_message(store, name, chance), field), members[field]))
            for field in contents
        }
        for payloads in (contents, others, contents):
            assembled = assembler.assemble(payloads)
            assert payloads is others or assembled == serialized, (
                f"type {number} of seed 32: {store.generate_msgdef(name)[0]}"
            )
        n_given, n_left = n_given + len(contents), n_left + len(members) - len(contents)
    assert n_given > 2 * n_drawn
    assert n_left > n_drawn / 2
