"""Messages that certify themselves: whoever gets one can tell, without what was sent, that each byte is as it was.

A certified message is a Vector3Stamped whose frame_id names its topic, and whose vector repeats its stamp, with a
checksum of both. A relay that restamps it changes the header's stamp and nothing else.
"""

from functools import cache
from struct import Struct
from zlib import crc32

from tests.ros.cdr_messages import NS_PER_SECOND, vector, with_stamp

_STAMP = Struct("<iI")
_STAMP_AT = 4
# x: seconds of the stamp, y: its nanoseconds, z: the checksum.
_VECTOR = Struct("<ddd")


def certified(topic: str, stamp: int) -> bytes:
    """The message of this stamp, in nanoseconds, on a topic."""
    payload = bytearray(_template(topic))
    seconds, nanoseconds = divmod(stamp, NS_PER_SECOND)
    _STAMP.pack_into(payload, _STAMP_AT, seconds, nanoseconds)
    checksum = crc32(payload[: -_VECTOR.size])
    _VECTOR.pack_into(payload, len(payload) - _VECTOR.size, seconds, nanoseconds, checksum)
    return bytes(payload)


def sent_stamp(topic: str, payload: bytes) -> int | None:
    """The stamp that a message of a topic was sent with; None if it is not, byte for byte, one that was sent.

    The header's stamp may be another: that is a relay's to set.
    """
    if len(payload) != len(_template(topic)):
        return None
    seconds, nanoseconds, _ = _VECTOR.unpack_from(payload, len(payload) - _VECTOR.size)
    if not (0 <= seconds < 1 << 31 and 0 <= nanoseconds < NS_PER_SECOND):
        return None
    stamp = int(seconds) * NS_PER_SECOND + int(nanoseconds)
    sent = certified(topic, stamp)
    unstamped = slice(_STAMP_AT + _STAMP.size, None)
    same = payload[:_STAMP_AT] == sent[:_STAMP_AT] and payload[unstamped] == sent[unstamped]
    return stamp if same else None


@cache
def _template(topic: str) -> bytes:
    return with_stamp(vector(0, frame_id=topic), 0)
