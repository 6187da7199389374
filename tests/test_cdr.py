"""Stamps in serialized messages, on bytes written by hand."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.cdr import has_place_for_stamp, patch_stamp, read_stamp

LITTLE_ENDIAN_IMAGE = (
    b"\x00\x01\x00\x00"  # CDR_LE, no options
    b"\x15\xcd\x5b\x07"  # sec 123456789
    b"\x08\x00\x00\x00"  # nanosec 8
    b"\x04\x00\x00\x00cam\x00"  # frame_id "cam"
    b"\xe0\x01\x00\x00"  # height 480
)
BIG_ENDIAN_IMAGE = (
    b"\x00\x00\x00\x00"  # CDR_BE, no options
    b"\x07\x5b\xcd\x15"  # sec 123456789
    b"\x00\x00\x00\x08"  # nanosec 8
    b"\x00\x00\x00\x04cam\x00"  # frame_id "cam"
    b"\x00\x00\x01\xe0"  # height 480
)


@pytest.mark.parametrize("payload", [LITTLE_ENDIAN_IMAGE, BIG_ENDIAN_IMAGE], ids=["little", "big"])
@pytest.mark.parametrize("container", [bytes, bytearray, memoryview])
def test_a_stamp_is_read_in_both_byte_orders_from_any_bytes(payload, container):
    assert read_stamp(container(payload)) == 123_456_789_000_000_008


@pytest.mark.parametrize(
    ("kind", "body"),
    [
        (0x00, b"\x00\x00\x00\x01\x00\x00\x00\x02"),  # CDR_BE
        (0x01, b"\x01\x00\x00\x00\x02\x00\x00\x00"),  # CDR_LE
        (0x06, b"\x00\x00\x00\x01\x00\x00\x00\x02"),  # CDR2_BE
        (0x07, b"\x01\x00\x00\x00\x02\x00\x00\x00"),  # CDR2_LE
    ],
)
def test_plain_encapsulations_are_read_whatever_their_options_say(kind, body):
    assert read_stamp(bytes([0x00, kind, 0x00, 0x03]) + body) == 1_000_000_002


@pytest.mark.parametrize(
    "payload",
    [
        pytest.param(b"", id="empty"),
        pytest.param(LITTLE_ENDIAN_IMAGE[:11], id="one byte short of its stamp"),
        pytest.param(b"\x00\x02" + LITTLE_ENDIAN_IMAGE[2:], id="parameter list"),
        pytest.param(b"\x00\x09" + LITTLE_ENDIAN_IMAGE[2:], id="delimited XCDR2"),
        pytest.param(b"\x01\x01" + LITTLE_ENDIAN_IMAGE[2:], id="first byte is not zero"),
    ],
)
def test_a_malformed_payload_has_no_stamp_and_cannot_be_patched(payload):
    assert read_stamp(payload) is None
    assert not has_place_for_stamp(payload)
    with pytest.raises(ValueError, match="no stamp to patch"):
        patch_stamp(payload, 1)


@pytest.mark.parametrize("nanoseconds", [b"\x00\xca\x9a\x3b", b"\xff\xff\xff\xff"], ids=["a second", "the most"])
def test_a_nanosecond_part_that_no_stamp_has_is_malformed_but_can_be_patched(nanoseconds):
    payload = b"\x00\x01\x00\x00\x00\x00\x00\x00" + nanoseconds
    assert read_stamp(payload) is None
    assert has_place_for_stamp(payload)
    assert read_stamp(patch_stamp(payload, 1)) == 1


def test_the_last_nanosecond_of_a_second_is_valid():
    assert read_stamp(b"\x00\x01\x00\x00\x00\x00\x00\x00\xff\xc9\x9a\x3b") == 999_999_999


def test_negative_seconds_are_valid_and_count_up_by_nanoseconds():
    assert read_stamp(b"\x00\x01\x00\x00\xff\xff\xff\xff\x01\x00\x00\x00") == -999_999_999


@pytest.mark.parametrize("payload", [LITTLE_ENDIAN_IMAGE, BIG_ENDIAN_IMAGE], ids=["little", "big"])
@pytest.mark.parametrize("container", [bytes, bytearray, memoryview])
def test_patching_changes_the_eight_bytes_of_the_stamp_and_no_other(payload, container):
    original = container(payload)
    patched = patch_stamp(original, 5_000_000_007)
    assert type(patched) is bytes
    assert read_stamp(patched) == 5_000_000_007
    assert (patched[:4], patched[12:]) == (payload[:4], payload[12:])
    assert bytes(original) == payload


@pytest.mark.parametrize("stamp", [-(2**31) * 10**9, -1, 0, 2**31 * 10**9 - 1])
def test_every_stamp_that_the_message_type_can_hold_is_patched(stamp):
    assert read_stamp(patch_stamp(LITTLE_ENDIAN_IMAGE, stamp)) == stamp


@pytest.mark.parametrize("stamp", [-(2**31) * 10**9 - 1, 2**31 * 10**9])
def test_a_stamp_beyond_the_message_type_is_refused(stamp):
    with pytest.raises(ValueError, match="does not fit"):
        patch_stamp(LITTLE_ENDIAN_IMAGE, stamp)


@given(st.binary(max_size=64))
def test_any_bytes_give_a_stamp_or_none(payload):
    stamp = read_stamp(payload)
    assert stamp is None or patch_stamp(payload, stamp) == payload


@given(st.sampled_from([0, 1, 6, 7]), st.binary(min_size=10, max_size=32))
def test_any_bytes_behind_a_known_encapsulation_survive_patching_with_their_own_stamp(kind, rest):
    payload = bytes([0, kind]) + rest
    stamp = read_stamp(payload)
    assert stamp is None or patch_stamp(payload, stamp) == payload
