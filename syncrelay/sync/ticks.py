"""The ticks of a clock that triggers sets, in whole nanoseconds, without drift."""

from dataclasses import dataclass

_NS_PER_SECOND = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Ticks:
    """Ticks at `numerator` / `denominator` Hz. Tick k is at k * 10**9 * denominator // numerator nanoseconds.

    They count from the epoch, so that the running relay, one that is started later and a replay have the same ticks.
    Multiples of a rounded period would drift: at 30 Hz by a whole tick in 39 days.
    """

    numerator: int
    denominator: int = 1

    def __post_init__(self) -> None:
        if self.numerator < 1 or self.denominator < 1:
            raise ValueError(f"numerator {self.numerator} and denominator {self.denominator} must be 1 or more")

    @property
    def hz(self) -> float:
        """How many ticks there are a second."""
        return self.numerator / self.denominator

    @property
    def period_ns(self) -> int:
        """The time between two ticks, rounded up."""
        return -(-_NS_PER_SECOND * self.denominator // self.numerator)

    def at(self, index: int) -> int:
        """Return the time of a tick."""
        return index * _NS_PER_SECOND * self.denominator // self.numerator

    def last_until(self, time: int) -> int:
        """Return the index of the last tick that is not after a time."""
        return -(-(time + 1) * self.numerator // (_NS_PER_SECOND * self.denominator)) - 1

    def first_from(self, time: int) -> int:
        """Return the index of the first tick that is not before a time."""
        return self.last_until(time - 1) + 1

    def __str__(self) -> str:
        return f"{self.hz:.10g} Hz"
