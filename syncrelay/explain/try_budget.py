"""How much may be tried out for suggestions: the engine runs on what came, and the relay has other things to do."""

from collections.abc import Callable, Iterable, Iterator
from typing import Final

from syncrelay.sync import Message

# A run costs 3 to 20 us a message, by what the engine has to do: a few runs for a group alone ...
_MESSAGES: Final = 30_000
# ... and for groups of one relay so much of the processor in a poll, after which no try begins, or goes on.
_BEGINS_NS: Final = 40_000_000
_ENDS_NS: Final = 80_000_000
_ASKED_EVERY: Final = 50


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

    def spent_on(self, messages: Iterable[Message]) -> Iterator[Message]:
        """Yield messages that a run takes. Raises OutOfTimeError where it takes too long.

        The first of a poll may take as long as it needs: on a slow machine none would end else.
        """
        for number, each in enumerate(messages):
            if self._has_finished and number % _ASKED_EVERY == 0 and self._spent() >= _ENDS_NS:
                raise OutOfTimeError
            self._left -= 1
            yield each
        self._has_finished = True

    def _spent(self) -> int:
        return self._clock() - self._began


class OutOfTimeError(Exception):
    """A try took too long."""
