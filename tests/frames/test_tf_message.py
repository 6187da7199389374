"""Frames read from bytes, against what rclpy's own serialization makes of the same messages."""

import struct

import pytest

from syncrelay.frames import Edge, read_frame, read_ros1_frame, read_transforms

# A TFMessage of one transform as CDR lays it out, little-endian, a field a line.
ONE = b"".join(
    (
        b"\x00\x01\x00\x00",  # CDR, little-endian
        b"\x01\x00\x00\x00",  # one transform
        b"\x07\x00\x00\x00",  # 7 s
        b"\x05\x00\x00\x00",  # 5 ns
        b"\x05\x00\x00\x00odom\x00",  # frame_id
        b"\x00\x00\x00",  # padding
        b"\x0a\x00\x00\x00base_link\x00",  # child_frame_id
        b"\x00\x00",  # padding to 4
        b"",  # at 44 from the start, so padding to 8:
    )
)


def transform(*, rotation=(0.0, 0.0, 0.0, 1.0), translation=(1.0, 2.0, 3.0), order="<"):
    return struct.pack(f"{order}7d", *translation, *rotation)


def one(**numbers):
    body = ONE[4:]
    return ONE + b"\x00" * (-len(body) % 8) + transform(**numbers)


EDGE = Edge("odom", "base_link", 7_000_000_005, is_static=False)


def test_a_transform_is_read_from_plain_cdr():
    assert read_transforms(one(), is_static=False) == [EDGE]
    assert read_transforms(one(), is_static=True) == [EDGE._replace(is_static=True)]


def test_a_transform_is_read_from_xcdr2_where_doubles_are_aligned_to_4_bytes():
    body = ONE[4:] + transform()
    assert len(ONE[4:]) % 4 == 0
    assert read_transforms(b"\x00\x07\x00\x00" + body, is_static=False) == [EDGE]


@pytest.mark.parametrize(
    "numbers",
    [
        {"rotation": (0.0, 0.0, 0.0, 0.0)},
        {"rotation": (0.0, 0.0, 0.2, 1.0)},
        {"rotation": (0.0, 0.0, 0.0, float("nan"))},
        {"translation": (float("nan"), 0.0, 0.0)},
    ],
)
def test_a_transform_that_tf2_refuses_is_left_out(numbers):
    assert read_transforms(one(**numbers), is_static=False) == []


def test_a_message_that_ends_early_gives_what_is_whole():
    whole = one()
    for length in range(len(whole)):
        assert read_transforms(whole[:length], is_static=False) == []
    lying = whole[:4] + b"\xff\xff\xff\xff" + whole[8:]
    assert read_transforms(lying, is_static=False) == [EDGE]
    assert read_transforms(b"\x00\x05" + whole[2:], is_static=False) == []


def test_the_frame_of_a_header_is_read_in_both_byte_orders():
    assert read_frame(b"\x00\x01\x00\x00" + bytes(8) + b"\x04\x00\x00\x00cam\x00") == "cam"
    assert read_frame(b"\x00\x00\x00\x00" + bytes(8) + b"\x00\x00\x00\x04cam\x00") == "cam"
    assert read_frame(b"\x00\x01\x00\x00" + bytes(8) + b"\x40\x00\x00\x00cam\x00") == ""
    assert read_frame(b"\x00\x01\x00\x00" + bytes(8) + b"\x02\x00\x00\x00\xff\x00") == ""
    assert read_frame(b"") == ""


def test_the_frame_of_a_ros1_header_is_read_behind_its_number():
    assert read_ros1_frame(bytes(12) + b"\x03\x00\x00\x00cam" + b"more") == "cam"
    assert read_ros1_frame(bytes(12) + b"\x02\x00\x00\x00\xff\xff") == ""
    assert read_ros1_frame(bytes(12)) == ""
