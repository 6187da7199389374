"""What is seen of a group and of its inputs at one moment, as values."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from syncrelay.explain.distribution import NOTHING, Distribution
from syncrelay.explain.drift import Drift
from syncrelay.explain.histogram import EMPTY, Histogram
from syncrelay.sync.messages import DropReason


@dataclass(frozen=True, slots=True)
class InputFigures:
    """One input; times and durations in nanoseconds, counts over the window.

    `usual_hz` is the rate of the last messages while they came, 0 of too few to tell; `longest_pause` the longest
    time between two of them. `pace_hz` is the rate by the median period, `slowed_from_hz` the steady pace that the
    input had before it fell to less than half of it, None if it has not. `delay` is the median of time of receipt
    minus stamp, `jitter` the 95th percentile of how far the time between two stamps is off its median; both are None
    while all stamps are 0. `nearest` holds, of an optional input, the spans of the tightest sets with it, whenever its
    messages came. `bursts` counts how often messages were held up and came at once, `held` is for how long at most.
    `fell_by` and `fell_at` tell of the last backward jump of its stamps.
    """

    rate_hz: float = 0.0
    usual_hz: float = 0.0
    longest_pause: int = 0
    pace_hz: float = 0.0
    slowed_from_hz: float | None = None
    fed: int = 0
    dropped: Mapping[DropReason, int] = field(default_factory=dict)
    last_received: int | None = None
    delay: int | None = None
    jitter: int | None = None
    drift: Drift | None = None
    duplicates: int = 0
    out_of_order: int = 0
    nearest: Distribution = NOTHING
    bursts: int = 0
    held: int = 0
    fell_by: int | None = None
    fell_at: int | None = None


@dataclass(frozen=True, slots=True)
class GroupFigures:
    """A group. `best_hz` is the rate of the input that sets the pace: no more sets are possible.

    `last_sets` are spans and latencies, the newest first. `nearest` holds the span of the tightest set that each
    message of the input that sets the pace could have had, `nearest_since` those measured after the last set;
    `missing` is the share of the window's sets, 0 to 1, that each input was missing from. `resumed` is when the first
    set left after a silence.
    """

    now: int
    began: int
    sets: int = 0
    rate_hz: float = 0.0
    best_hz: float = 0.0
    last_set: int | None = None
    resumed: int | None = None
    last_sets: tuple[tuple[int, int], ...] = ()
    span_histogram: Histogram = EMPTY
    latency_histogram: Histogram = EMPTY
    spans: Distribution = NOTHING
    latencies: Distribution = NOTHING
    nearest: Distribution = NOTHING
    nearest_since: Distribution = NOTHING
    missing: tuple[float, ...] = ()
