"""What is seen of a group and of its inputs at one moment, as values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from operator import sub
from statistics import median_low
from typing import Final

from syncrelay.explain.clocks import Drift, Step
from syncrelay.explain.distribution import EMPTY, NOTHING, Distribution, Histogram
from syncrelay.explain.standing import NOT_KNOWN, Share
from syncrelay.sync.messages import DropReason

_SHOWN_SETS: Final = 100


@dataclass(frozen=True, slots=True)
class InputFigures:
    """One input; times and durations in nanoseconds, counts over the window.

    `usual_hz` is the rate of the last messages while they came, 0 of too few to tell. `pace_hz` is the rate by the
    median period, `slowed_from_hz` the steady pace that the input had before it slowed down, None if it has not.
    `flows_since` is when the first message of all came, or the first after a silence. Of the last messages, oldest
    first, `received` holds when they came, `stamps` and `delays`, the times of receipt minus the stamps, leave out
    stamps of 0. `nearest` holds, of an optional input, the spans of the tightest sets with it, whenever its messages
    came. `bursts` counts how often messages were held up and came at once, `held` is for how long at most, `held_up`
    from when to when, each time. `fell_by` and `fell_at` tell of the last backward jump of its stamps, `stepped` of a
    lasting step of them against the times of receipt in the last half minute; `swings` counts how often they stepped
    there and back, `swung_by` is how far.
    """

    rate_hz: float = 0.0
    usual_hz: float = 0.0
    pace_hz: float = 0.0
    slowed_from_hz: float | None = None
    fed: int = 0
    dropped: Mapping[DropReason, int] = field(default_factory=dict)
    flows_since: int | None = None
    received: Sequence[int] = ()
    stamps: Sequence[int] = ()
    delays: Sequence[int] = ()
    drift: Drift | None = None
    duplicates: int = 0
    out_of_order: int = 0
    nearest: Distribution = NOTHING
    bursts: int = 0
    held: int = 0
    held_up: Sequence[tuple[int, int]] = ()
    fell_by: int | None = None
    fell_at: int | None = None
    stepped: Step | None = None
    swings: int = 0
    swung_by: int = 0

    # Worked out when they are asked for, which is not at every look.

    @property
    def last_received(self) -> int | None:
        """When the last message came, None before the first."""
        return self.received[-1] if self.received else None

    @property
    def longest_pause(self) -> int:
        """The longest time between two of the last messages."""
        return max(_steps(self.received), default=0)

    @property
    def delay(self) -> int | None:
        """The median of the delays, None while all stamps are 0."""
        return median_low(self.delays) if self.delays else None

    @property
    def jitter(self) -> int | None:
        """The 95th percentile of how far the time between two stamps is off its median, None of less than two."""
        periods = _steps(self.stamps)
        if not periods:
            return None
        usual = median_low(periods)
        return Distribution([abs(period - usual) for period in periods]).quantile(0.95)


def _steps(times: Sequence[int]) -> Sequence[int]:
    return list(map(sub, times[1:], times))


@dataclass(frozen=True, slots=True)
class GroupFigures:
    """A group. `best_hz` is the rate of the input, or of the clock, that sets the pace: no more sets are possible.

    `spans` and `latencies` are those of the last sets. `nearest` holds the span of the tightest set that each of the
    last messages of the input that sets the pace could have had, measured since `nearest_from`, and since an input last
    changed its pace; `nearest_since` those measured after the last set. `missing` is the share of the window's sets, 0
    to 1, that each input was missing from, `sets_since_without` how many sets had it since. `resumed` is when the first
    set left after a silence. `share` says how many of the possible sets left.
    """

    now: int
    began: int
    sets: int = 0
    rate_hz: float = 0.0
    best_hz: float = 0.0
    last_set: int | None = None
    resumed: int | None = None
    share: Share = NOT_KNOWN
    span_histogram: Histogram = EMPTY
    latency_histogram: Histogram = EMPTY
    spans: Distribution = NOTHING
    latencies: Distribution = NOTHING
    nearest: Distribution = NOTHING
    nearest_since: Distribution = NOTHING
    nearest_from: int = 0
    missing: tuple[float, ...] = ()
    sets_since_without: tuple[int, ...] = ()

    @property
    def last_sets(self) -> tuple[tuple[int, int], ...]:
        """Spans and latencies of the last sets, the newest first."""
        return tuple(zip(self.spans.newest(_SHOWN_SETS), self.latencies.newest(_SHOWN_SETS), strict=True))
