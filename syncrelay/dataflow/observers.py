"""What the relay observes of itself: standstills, waits, losses, and clocks that step or stop. Times in nanoseconds."""

from collections import deque
from collections.abc import Hashable
from typing import Final

from syncrelay.explain import STEP_NS, ClockState, Standstill, Step
from syncrelay.runtime import SYSTEM, Runtime

# What was lost, and what had to wait, is reported for the last ten evaluations.
_RECENT: Final = 10
# So many evaluations after a publisher was found, its first messages have arrived: it may find the subscription only
# with the next announcement, 3 s later, and what its history has dropped by then counts as lost.
_SETTLING: Final = 5
# Fast DDS announces a node every 3 s, and what it publishes is known some tenths of a second later.
_UNCHANGED_S: Final = 4.0
# A graph in which nodes come and go all the time never rests: three announcements are enough.
_DISCOVERED_AT_LATEST_S: Final = 10.0
# A clock that is set moves at once; one that is slewed only runs faster or slower.
_STEP_NS: Final = 100_000_000
_READINGS: Final = 3
_TOLD_NS: Final = 30_000_000_000
# A /clock at 1 Hz stands still for a second between two ticks.
_CLOCK_STOPPED_NS: Final = 2_500_000_000


class Standstills:
    """How long the process did not run, as seen by a thread that works in short steps and rests between them."""

    def __init__(self, *, runtime: Runtime = SYSTEM) -> None:
        self._runtime = runtime
        self._recent: deque[Standstill | None] = deque(maxlen=_RECENT)
        self._longest_now: Standstill | None = None
        self._began = self._runtime.monotonic_ns()

    def begin(self) -> None:
        """Begin a step now."""
        self._began = self._runtime.monotonic_ns()

    def end(self, *, rest: int = 0) -> None:
        """Note how long a step took, without the rest that it took on purpose; the next one begins now."""
        before = self._began
        self.begin()
        self.note(Standstill(self._runtime.time_ns(), self._began - before - rest, rest))

    def note(self, standstill: Standstill) -> None:
        """Take a standstill that ends now."""
        if self._longest_now is None or standstill.ns > self._longest_now.ns:
            self._longest_now = standstill

    def observe(self) -> None:
        """Begin the next evaluation."""
        self._recent.append(self._longest_now)
        self._longest_now = None

    @property
    def recent(self) -> tuple[Standstill, ...]:
        """The longest of each of the last evaluations."""
        return tuple(filter(None, self._recent))


class Waits:
    """How long messages of a topic waited for the relay."""

    def __init__(self) -> None:
        self._recent: deque[int] = deque(maxlen=_RECENT)

    def observe(self, waited: int) -> None:
        """Take the longest wait since the last evaluation."""
        self._recent.append(waited)

    @property
    def longest(self) -> int:
        """The longest of the last evaluations."""
        return max(self._recent, default=0)


class Losses:
    """How many messages of a topic DDS lost. What a new publisher sent before it was found is no loss."""

    def __init__(self) -> None:
        self._totals: deque[int] = deque(maxlen=_RECENT)
        self.total = 0
        """How many were lost since the relay started."""
        self._publishers = 0
        self._settling = 0

    def observe(self, total: int, *, publishers: int) -> None:
        """Take the total lost since the subscription was made, and how many publishers there are."""
        if publishers > self._publishers or (self._totals and total < self._totals[-1]):
            self._settling = _SETTLING
        if self._settling:
            self._settling -= 1
            self._totals.clear()
        elif self._totals:
            self.total += total - self._totals[-1]
        self._publishers = publishers
        self._totals.append(total)

    @property
    def recent(self) -> int:
        """How many were lost in the last evaluations."""
        return self._totals[-1] - self._totals[0] if self._totals else 0


class Discovery:
    """Whether nodes that run may still be missing from the graph, because this one has just joined it.

    Fast DDS finds most at once. A node that missed the first announcements is found at the next, which come every 3 s.
    So discovery is over once the graph has stayed as it is for longer than that.
    """

    def __init__(self, *, now: float) -> None:
        """Take the monotonic time in seconds, here as below."""
        self._latest = now + _DISCOVERED_AT_LATEST_S
        self._ends = now + _UNCHANGED_S
        self._graph: Hashable = None

    def observe(self, graph: Hashable, *, now: float) -> None:
        """Take what the graph holds, to see whether it has changed."""
        if self._graph not in (None, graph) and self.goes_on(now):
            self._ends = min(now + _UNCHANGED_S, self._latest)
        self._graph = graph

    def goes_on(self, now: float) -> bool:
        """Whether nodes may still be found that were there before."""
        return now < self._ends


class SystemClock:
    """Whether the system's clock was set."""

    def __init__(self, *, runtime: Runtime = SYSTEM) -> None:
        self._runtime = runtime
        self._offset = _offset(runtime)
        self._step: Step | None = None

    def has_stepped(self, now: int) -> bool:
        """Whether it was set since this was last asked."""
        before, self._offset = self._offset, _offset(self._runtime)
        by = self._offset - before
        if abs(by) >= STEP_NS:
            self._step = Step(now, by)
        return abs(by) > _STEP_NS

    def last_step(self, now: int) -> Step | None:
        """Return when it was last set and by how much, if that was half a second or more, in the last half minute."""
        return self._step if self._step and 0 <= now - self._step.at < _TOLD_NS else None


def _offset(runtime: Runtime) -> int:
    """How far the system's clock is ahead of the monotonic one."""
    # The quickest of a few readings: a thread that was interrupted between the two clocks would see a step.
    return min(_reading(runtime) for _ in range(_READINGS))[1]


def _reading(runtime: Runtime) -> tuple[int, int]:
    before = runtime.monotonic_ns()
    system = runtime.time_ns()
    after = runtime.monotonic_ns()
    return after - before, system - (before + after) // 2


class SimulatedClock:
    """Whether simulated time moves, and what it was when messages were received."""

    def __init__(self, *, runtime: Runtime = SYSTEM) -> None:
        self._moved_at = runtime.time_ns()
        self._now = (self._moved_at, 0)
        self._rate = 1.0
        self.is_steady = False
        """Whether it ran on since the last evaluation: only then is it known what it was in between."""
        self.state = ClockState(received=False)

    def observe(self, simulated: int, *, now: int) -> None:
        """Take the simulated time of now, 0 before the first."""
        before_at, before = self._now
        self.is_steady = 0 < before <= simulated and before_at < now
        self._rate = (simulated - before) / (now - before_at) if self.is_steady else 1.0
        if simulated != before:
            self._moved_at = now
        self._now = (now, simulated)
        still = now - self._moved_at
        self.state = ClockState(simulated != 0, still if still >= _CLOCK_STOPPED_NS else None)

    def at(self, received: int) -> int:
        """Return the simulated time at which a message was received since the last evaluation but one."""
        now, simulated = self._now
        return simulated - round((now - received) * self._rate)
