"""Stamps in serialized messages, read and patched without decoding the messages.

A payload is a message as DDS carries it: four bytes of encapsulation header (DDSI-RTPS 2.5, 10.2), then the
fields. Where the first field is a std_msgs/Header, its stamp stands first: int32 seconds and uint32
nanoseconds, in the byte order that the encapsulation names. Plain CDR and plain XCDR2 lay it out alike.
"""

from struct import Struct, error
from typing import Final, TypeAlias

Payload: TypeAlias = bytes | bytearray | memoryview

_NS_PER_SECOND: Final = 1_000_000_000
_STAMP_AT: Final = 4
_STAMP_END: Final = 12
_MIN_SECONDS: Final = -(2**31)
_MAX_SECONDS: Final = 2**31 - 1
LATEST_STAMP: Final = _MAX_SECONDS * _NS_PER_SECOND + _NS_PER_SECOND - 1
"""The greatest stamp that a Header can hold, of January 2038, in nanoseconds."""

_BIG_ENDIAN: Final = Struct(">iI")
_LITTLE_ENDIAN: Final = Struct("<iI")
# The second byte of the encapsulation header; the first is 0 for all of them.
_STAMP_LAYOUTS: Final = {
    0x00: _BIG_ENDIAN,  # CDR_BE
    0x01: _LITTLE_ENDIAN,  # CDR_LE
    0x06: _BIG_ENDIAN,  # CDR2_BE
    0x07: _LITTLE_ENDIAN,  # CDR2_LE
}
# The first two bytes of the encapsulation header as a little-endian number, and the stamp: one call for nearly all.
_ENCAPSULATED: Final = Struct("<H2xiI").unpack_from
_LITTLE_ENDIANS: Final = frozenset(kind << 8 for kind, layout in _STAMP_LAYOUTS.items() if layout is _LITTLE_ENDIAN)
_BIG_ENDIANS: Final = frozenset(kind << 8 for kind, layout in _STAMP_LAYOUTS.items() if layout is _BIG_ENDIAN)


def read_stamp(payload: Payload) -> int | None:
    """Return the stamp of the leading Header in nanoseconds, or None if the payload is malformed.

    A payload is malformed if it ends before the end of the stamp, is neither plain CDR nor plain XCDR2, or has
    nanoseconds of a second or more. Negative seconds are valid (builtin_interfaces/Time).
    """
    try:
        encapsulation, seconds, nanoseconds = _ENCAPSULATED(payload)
    except error:
        return None
    if encapsulation not in _LITTLE_ENDIANS:
        if encapsulation not in _BIG_ENDIANS:
            return None
        seconds, nanoseconds = _BIG_ENDIAN.unpack_from(payload, _STAMP_AT)
    if nanoseconds >= _NS_PER_SECOND:
        return None
    stamp: int = seconds * _NS_PER_SECOND + nanoseconds
    return stamp


def has_place_for_stamp(payload: Payload) -> bool:
    """Tell whether a payload is long enough and of an encapsulation in which a leading stamp can be set."""
    return len(payload) >= _STAMP_END and not payload[0] and payload[1] in _STAMP_LAYOUTS


def patch_stamp(payload: Payload, stamp: int) -> bytes:
    """Return the payload with the stamp of its leading Header set to `stamp` nanoseconds.

    Raises ValueError for a payload that has no place for one, and for a stamp whose seconds don't fit an int32.
    """
    if not has_place_for_stamp(payload):
        raise ValueError("the payload has no stamp to patch")
    seconds, nanoseconds = divmod(stamp, _NS_PER_SECOND)
    if not _MIN_SECONDS <= seconds <= _MAX_SECONDS:
        raise ValueError(f"a stamp of {stamp} ns does not fit builtin_interfaces/Time")
    whole = memoryview(payload)
    return b"".join((whole[:_STAMP_AT], _STAMP_LAYOUTS[payload[1]].pack(seconds, nanoseconds), whole[_STAMP_END:]))
