"""What became of every message: fed = matched + dropped + buffered, for each input, at any moment."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from syncrelay.sync.lending import Fed
from syncrelay.sync.messages import DropReason, Match, Outcome


@dataclass(frozen=True, slots=True)
class InputCounts:
    """Messages of one input since the group was made. `dropped` holds only reasons that occurred.

    `needed_queue` is the length at which this input's queue would have held every message that a message of another
    input needed and that had overflowed; None if that never happened. Lengths above 1000 are ignored: they come from
    stamps of another clock, which no queue makes good.
    """

    fed: int
    matched: int
    dropped: Mapping[DropReason, int]
    buffered: int
    needed_queue: int | None = None


class Ledger:
    """Counts what arrives and what leaves. A message that is in several sets (`repeats`) is counted once."""

    __slots__ = ("_absent", "_dropped", "_last", "_repeats", "fed", "sets")

    def __init__(self, n_inputs: int, *, repeats: bool) -> None:
        self.fed = [0] * n_inputs
        self.sets = 0
        # Sets without a new message of this input. Counting these is cheaper than counting matched messages.
        self._absent = [0] * n_inputs
        self._dropped: list[dict[DropReason, int]] = [defaultdict(int) for _ in self.fed]
        self._repeats = repeats
        self._last: list[int | None] = [None] * n_inputs

    def note(self, outcomes: Sequence[Outcome]) -> None:
        """Count what leaves."""
        for outcome in outcomes:
            if isinstance(outcome, Match):
                self.sets += 1
                if self._repeats:
                    self._note_repeated(outcome)
                elif not all(outcome.messages):
                    for index, message in enumerate(outcome.messages):
                        self._absent[index] += message is None
            else:
                self._dropped[outcome.message.input][outcome.reason] += 1

    def note_lent(self, sets: int, inputs: Sequence[Fed]) -> None:
        """Count what came and left while the engine lent its search."""
        self.sets += sets
        for index, each in enumerate(inputs):
            self.fed[index] += each.messages
            for reason, count in each.dropped.items():
                self._dropped[index][reason] += count

    def note_sets(self, sets: int) -> None:
        """Count so many sets, of a new message of each input."""
        self.sets += sets
        self.fed[:] = [fed + sets for fed in self.fed]

    def forget(self) -> None:
        """Count every message from now on as new, whatever its stamp."""
        self._last = [None] * len(self.fed)

    def counts(self, buffered: Sequence[int], needed_queues: Sequence[int | None]) -> tuple[InputCounts, ...]:
        """Return the counts of each input, given what its buffers hold now."""
        rows = zip(self.fed, self._absent, self._dropped, buffered, needed_queues, strict=True)
        return tuple(
            InputCounts(fed, self.sets - absent, dict(dropped), held, needed)
            for fed, absent, dropped, held, needed in rows
        )

    def _note_repeated(self, match: Match) -> None:
        for index, message in enumerate(match.messages):
            if message is None or message.stamp == self._last[index]:
                self._absent[index] += 1
            else:
                self._last[index] = message.stamp
