"""What cannot be read of a file: a sentence for each damaged place, and one for each reason to leave out messages."""

from collections import Counter
from typing import Final

from syncrelay.config.wording import counted
from syncrelay.recordings.bag.recording import LATEST, Channel, RawMessage

STRAY: Final[RawMessage] = (Channel(-1, "", "", ""), -1, b"")
"""Stands for a message whose channel the file does not describe; its time sorts before all others."""

OF_NO_CHANNEL: Final = "channel not described in the file"
OF_NO_TIME: Final = "received before 1970 or after 2116"


_MOST_SAID: Final = 100
"""How many damaged places are named. Further ones are only counted."""


class Losses:
    """Collects what is lost while a file is read."""

    def __init__(self, name: str) -> None:
        """Collect for a file that messages call `name`."""
        self._name = name
        self._said: list[str] = []
        self._more = 0
        self._left_out: Counter[str] = Counter()
        self._too_late = 0

    @property
    def sentences(self) -> list[str]:
        """What was lost so far, a sentence each."""
        sentences = [f"{counted(count, 'message')} left out: {why}" for why, count in self._left_out.items() if count]
        if self._too_late:
            sentences.append(f"{counted(self._too_late, 'message')} out of order: the index has other times")
        if self._more:
            sentences.append(f"{counted(self._more, 'more place')} that cannot be read")
        return [*self._said, *(f"{self._name}: {each}" for each in sentences)]

    def say(self, what: str) -> None:
        """Add a sentence on what is wrong with the file."""
        self._said.append(f"{self._name}: {what}")

    def cut_off(self, place: int, size: int) -> None:
        """Add that nothing can be read from byte `place` on."""
        self.say(f"cut off or damaged at byte {place} of {size}; read up to there")

    def not_closed(self) -> None:
        """Add that the file ends without the end that a recorder writes."""
        self.say("was not closed, or is cut off; read to its end")

    def damaged(self, what: str, fault: BaseException, *, read: int = 0) -> None:
        """Add that something, named with its article, is damaged, and how many messages of it could be read."""
        if len(self._said) >= _MOST_SAID:
            self._more += 1
            return
        why = "there is not enough memory for it" if isinstance(fault, MemoryError) else fault
        kept = f"after {counted(read, 'readable message')}" if read else "and left out"
        self.say(f"{what} is damaged {kept}{f': {why}' if str(why) else ''}")

    def leave_out(self, why: str, count: int = 1) -> None:
        """Count messages that are left out for the same reason."""
        self._left_out[why] += count

    def too_late(self, count: int) -> None:
        """Count messages that come after later ones."""
        self._too_late += count

    def kept(self, messages: list[RawMessage]) -> list[RawMessage]:
        """Return the messages with a known channel and a valid time, and count the others; they are sorted by time."""
        if not messages or (messages[0][1] >= 0 and messages[-1][1] <= LATEST):
            return messages
        good = [each for each in messages if 0 <= each[1] <= LATEST]
        strays = sum(each is STRAY for each in messages)
        self.leave_out(OF_NO_CHANNEL, strays)
        self.leave_out(OF_NO_TIME, len(messages) - len(good) - strays)
        return good
