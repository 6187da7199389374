"""Stamps in serialized messages, on bytes written by hand."""

import struct

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


# Of plain encapsulations, the byte order of each: CDR_BE, CDR_LE, CDR2_BE, CDR2_LE.
_ORDERS = {0x00: ">", 0x01: "<", 0x06: ">", 0x07: "<"}
_SECONDS, _BEYOND = 2**31, 10**9


@pytest.mark.parametrize("payload", [LITTLE_ENDIAN_IMAGE, BIG_ENDIAN_IMAGE], ids=["little", "big"])
def test_a_stamp_is_read_in_both_byte_orders(payload):
    assert read_stamp(payload) == 123_456_789_000_000_008


_PARTS = st.tuples(
    st.sampled_from([*_ORDERS]),
    st.binary(min_size=2, max_size=2),
    st.sampled_from([-_SECONDS, -1, 0, _SECONDS - 1]) | st.integers(-_SECONDS, _SECONDS - 1),
    st.sampled_from([0, _BEYOND - 1, _BEYOND, 2**32 - 1]) | st.integers(0, 2**32 - 1),
    st.binary(max_size=9),
)


@given(
    _PARTS, st.integers(-_SECONDS * _BEYOND, _SECONDS * _BEYOND - 1), st.sampled_from([bytes, bytearray, memoryview])
)
def test_the_eight_bytes_of_a_stamp_are_read_and_patched_and_no_other(parts, stamp, held):
    kind, options, sec, nanosec, rest = parts
    head = bytes([0, kind]) + options
    payload = head + struct.pack(f"{_ORDERS[kind]}iI", sec, nanosec) + rest
    # Nanoseconds that no stamp has are malformed, but can be patched.
    assert read_stamp(held(payload)) == (sec * _BEYOND + nanosec if nanosec < _BEYOND else None)
    assert has_place_for_stamp(payload)
    patched = patch_stamp(held(payload), stamp)
    assert type(patched) is bytes
    assert patched == head + struct.pack(f"{_ORDERS[kind]}iI", *divmod(stamp, _BEYOND)) + rest


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


@pytest.mark.parametrize("stamp", [-(2**31) * 10**9 - 1, 2**31 * 10**9])
def test_a_stamp_beyond_the_message_type_is_refused(stamp):
    with pytest.raises(ValueError, match="does not fit"):
        patch_stamp(LITTLE_ENDIAN_IMAGE, stamp)


@given(st.binary(max_size=64))
def test_any_bytes_give_a_stamp_or_none(payload):
    stamp = read_stamp(payload)
    assert stamp is None or patch_stamp(payload, stamp) == payload
