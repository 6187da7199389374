"""How much may be tried out for suggestions: the engine runs on what came, and the relay has other things to do."""

from collections.abc import Callable, Iterable, Iterator
from typing import Final

from syncrelay.explain.received import Messages

# A run costs 3 to 20 us a message, by what the engine has to do: a few runs for a group alone ...
_MESSAGES: Final = 30_000
# ... and for groups of one relay so much of the processor in a poll, after which no try begins, or goes on.
_BEGINS_NS: Final = 40_000_000
_ENDS_NS: Final = 80_000_000
_ASKED_EVERY: Final = 250


class TryBudget:
    """How much may be tried out until the next poll, by all groups that share it.

    It is a number of messages that are run through engines, and a share of the processor's time by `clock`, in
    nanoseconds, which usually ends first. With a clock that stands still, only the messages count: what is tried out is
    then the same on any machine.
    """

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock = clock
        self._is_wanted = False
        self.refill()

    def refill(self) -> None:
        """Begin a poll."""
        self._began = self._clock()
        self._left = _MESSAGES
        self._has_finished = False
        self.is_short, self._is_wanted = self._is_wanted, False
        """Whether the poll before had no time for something that was never tried."""

    def want(self) -> None:
        """Note that there was no time for something that was never tried."""
        self._is_wanted = True

    @property
    def is_spent(self) -> bool:
        """Whether no run may begin any more."""
        return self._left <= 0 or self._spent() >= _BEGINS_NS

    def spent_on(self, messages: Iterable[Messages]) -> Iterator[Messages]:
        """Yield messages that a run takes. Raises OutOfTimeError where it takes too long.

        The first of a poll may take as long as it needs: on a slow machine none would end else.
        """
        for some in messages:
            for begin in range(0, len(some.inputs), _ASKED_EVERY):
                if self._has_finished and self._spent() >= _ENDS_NS:
                    raise OutOfTimeError
                part = some.part(begin, begin + _ASKED_EVERY)
                self._left -= len(part.inputs)
                yield part
        self._has_finished = True

    def _spent(self) -> int:
        return self._clock() - self._began


class OutOfTimeError(Exception):
    """A try took too long."""
