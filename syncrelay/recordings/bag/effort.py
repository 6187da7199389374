"""Limits on the work between two messages of a file: without them a few crafted bytes could cost hours."""

from typing import Final

ALWAYS_FITS: Final = 1 << 26
"""Bytes that may be unpacked without finding a message, however few are packed: several large images of one color."""

MOST_TIMES: Final = 1024
"""Beyond that, the largest ratio of unpacked to packed bytes without a message. gzip never reaches it."""

LARGEST: Final = 1 << 30
"""The largest size of an unpacked chunk or message, in bytes."""

MOST_RECORDS: Final = 1 << 17
"""The most records in a row that are no message: an MCAP file has at most 65,535 schemas and as many channels."""

TOO_MUCH: Final = f"it unpacks to more than {ALWAYS_FITS >> 20} MiB and {MOST_TIMES:,} times its size"


def room_for(packed: int) -> int:
    """Return how many bytes may be unpacked from `packed` bytes without finding a message."""
    return ALWAYS_FITS + MOST_TIMES * packed


class Effort:
    """The work that one reading of a file has done since its last message, and may still do."""

    def __init__(self) -> None:
        self.found_message()
        self._left = LARGEST

    def found_message(self) -> None:
        """Start counting from zero again."""
        self._room = ALWAYS_FITS
        self._records = 0

    def pass_record(self) -> None:
        """Count a record that is no message; raises ValueError if there are too many in a row."""
        self._records += 1
        if self._records > MOST_RECORDS:
            raise ValueError(f"no message is among {MOST_RECORDS:,} records")

    def begin(self, packed: int) -> None:
        """Call this before a chunk or message of `packed` bytes is unpacked."""
        self._room += MOST_TIMES * packed
        self._left = LARGEST

    @property
    def most(self) -> int:
        """How many bytes of the present chunk or message may still be unpacked."""
        return min(self._room, self._left)

    def require_room(self, size: int) -> None:
        """Raise ValueError if `size` more bytes are too many."""
        if size > self._left:
            raise ValueError("it unpacks to more than 1 GiB")
        if size > self._room:
            raise ValueError(TOO_MUCH)

    def unpack(self, size: int) -> None:
        """Count unpacked bytes; raises ValueError if they are too many."""
        self.require_room(size)
        self._room -= size
        self._left -= size
