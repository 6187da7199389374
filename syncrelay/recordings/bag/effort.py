"""What is spent on a file between two messages, within bounds: a few bytes that hold none could cost hours."""

from typing import Final

ALWAYS_FITS: Final = 1 << 26
"""Bytes that may be unpacked without a message, however few are packed: several large images of one color."""

MOST_TIMES: Final = 1024
"""How many times its packed size may be unpacked beside that without a message: gzip never packs more."""

LARGEST: Final = 1 << 30
"""Bytes that a chunk or a message may unpack to."""

MOST_RECORDS: Final = 1 << 17
"""Records that may come without a message: an MCAP file has 65,535 schemas and as many channels at most."""

TOO_MUCH: Final = f"it unpacks to more than {ALWAYS_FITS >> 20} MiB and {MOST_TIMES:,} times its size"


def room_for(packed: int) -> int:
    """Return how many bytes so many may unpack to without a message."""
    return ALWAYS_FITS + MOST_TIMES * packed


class Effort:
    """What one reading of a file has taken since its last message, and may still take."""

    def __init__(self) -> None:
        """Begin with nothing spent."""
        self._room = room_for(0)
        self._left = 0
        self._records = 0

    def found_message(self) -> None:
        """Begin anew."""
        self._room = room_for(0)
        self._records = 0

    def pass_record(self) -> None:
        """Take in a record that is no message; raises ValueError where there are too many of them."""
        self._records += 1
        if self._records > MOST_RECORDS:
            raise ValueError(f"no message is among {MOST_RECORDS:,} records")

    def begin(self, packed: int) -> None:
        """Take in that a chunk or a message of so many bytes is unpacked now."""
        self._room += MOST_TIMES * packed
        self._left = LARGEST

    @property
    def most(self) -> int:
        """How many bytes of it may still be unpacked."""
        return max(0, min(self._room, self._left))

    def require_room(self, size: int) -> None:
        """Raise ValueError where so many bytes may not be unpacked."""
        if size > self._left:
            raise ValueError("it unpacks to more than 1 GiB")
        if size > self._room:
            raise ValueError(TOO_MUCH)

    def unpack(self, size: int) -> None:
        """Take in that so many bytes of it were unpacked; raises ValueError where those are too many."""
        self.require_room(size)
        self._room -= size
        self._left -= size
