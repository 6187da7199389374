"""What is so of every set that comes out, whatever happened to those who sent, relayed and received it."""

from collections.abc import Sequence

from tests.faults.certified import sent_stamp
from tests.ros.cdr_messages import stamp_of

# A message whose partners have not come within so many sets will not be joined by them.
_PENDING = 20_000
_FAULTS_TOLD = 10


class SetLaw:
    """Takes certified messages as they come out and notes what is wrong.

    Each is byte for byte one that was sent on its topic; none comes twice, none is older than one before it; the
    messages of a set have its earliest stamp, by which they are known, and are no farther apart than slop.
    """

    def __init__(self, topics: Sequence[str], *, slop: int) -> None:
        self.messages = [0] * len(topics)
        self.sets = 0
        self.faults: list[str] = []
        self.last_set: int | None = None
        """The common stamp of the last set that came whole."""
        self._topics = topics
        self._slop = slop
        self._newest: list[int | None] = [None] * len(topics)
        self._pending: dict[int, dict[int, int]] = {}

    @property
    def unpaired(self) -> int:
        """How many messages came of which a partner has not come."""
        return sum(self.messages) - self.sets * len(self._topics)

    def take(self, index: int, payload: bytes) -> None:
        """Take a message of the output of one topic."""
        self.messages[index] += 1
        stamp = sent_stamp(self._topics[index], payload)
        if stamp is None:
            self._fault(f"{self._topics[index]}: nobody sent {payload.hex()}")
            return
        newest = self._newest[index]
        if newest is not None and stamp <= newest:
            how = "comes again" if stamp == newest else f"comes after {newest}"
            self._fault(f"{self._topics[index]}: {stamp} {how}")
        self._newest[index] = stamp
        self._pair(index, stamp, stamp_of(payload))

    def _pair(self, index: int, stamp: int, header_stamp: int) -> None:
        stamps = self._pending.setdefault(header_stamp, {})
        stamps[index] = stamp
        if len(stamps) == len(self._topics):
            del self._pending[header_stamp]
            if min(stamps.values()) != header_stamp:
                self._fault(f"a set of {sorted(stamps.values())} left with the stamp {header_stamp}")
            self.sets += 1
            self.last_set = header_stamp
            span = max(stamps.values()) - min(stamps.values())
            if span > self._slop:
                self._fault(f"a set spans {span} ns, slop is {self._slop}: {sorted(stamps.values())}")
        elif len(self._pending) > _PENDING:
            del self._pending[next(iter(self._pending))]

    def _fault(self, text: str) -> None:
        if len(self.faults) < _FAULTS_TOLD:
            self.faults.append(text)
