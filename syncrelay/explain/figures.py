"""What is seen of a group and of its inputs at one moment, as values."""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import sub
from statistics import median_low
from typing import Final

from syncrelay.clock import Step
from syncrelay.explain.clocks import Drift
from syncrelay.explain.distribution import EMPTY, NOTHING, Distribution, Histogram
from syncrelay.explain.epochs import Reading
from syncrelay.explain.standing import NOT_KNOWN, Share, Shares
from syncrelay.sync.messages import DropReason

_SHOWN_SETS: Final = 100


@dataclass(slots=True)  # frozen, it would cost three times as much to make, at each look
class InputFigures:
    """One input; times and durations in nanoseconds, counts over the window. `InputObservation.figures` fills it in.

    Of its last messages, the oldest is first.
    """

    rate_hz: float = 0.0
    """Its rate over the window."""
    usual_hz: float = 0.0
    """The rate of its last messages while they came. 0 if they are too few."""
    pace_hz: float = 0.0
    """The rate by the median period."""
    slowed_from_hz: float | None = None
    """The steady rate that it had before it slowed down. None if it has not."""
    may_be_slower: bool = False
    """Whether its last few messages came so much slower that it has slowed down if they go on so."""
    fed: int = 0
    """How many messages arrived."""
    dropped: Mapping[DropReason, int] = field(default_factory=dict)
    """How many were dropped, by reason."""
    last_faults: Mapping[DropReason, int] = field(default_factory=dict)
    """When messages were last seen that were malformed, had no stamp or repeated one."""
    changed_at: int = 0
    """When its stamps or its pace were last found to be others than before."""
    flows_since: int | None = None
    """When its first message came, or the first after a silence."""
    received: Sequence[int] = ()
    """When its last messages were received."""
    stamps: Sequence[int] = ()
    """Their stamps, without those of 0."""
    delays: Sequence[int] = ()
    """Their times of receipt minus their stamps, without stamps of 0."""
    least_delay: int | None = None
    """The least of the look at which it was nearest to none, in the last minute. None where its clock was just set."""
    drift: Drift | None = None
    """How its stamps drift against the times of receipt."""
    reading: Reading | None = None
    """How its stamps have to be read. None where they run as time does."""
    resolution: int = 0
    """Of which unit all its stamps are multiples: 1 s, 100 or 10 ms. 0 of none of these."""
    duplicates: int = 0
    """How many repeated a stamp."""
    out_of_order: int = 0
    """How many had an older stamp than the one before."""
    faulty_looks: int = 2
    """In how many looks there were such stamps: in one alone where a clock was set."""
    faulty_since: int | None = None
    """When the last but one of these looks was. None of fewer."""
    nearest: Distribution = NOTHING
    """Of an optional input: the spans of the tightest sets with it, whenever its messages came."""
    bursts: int = 0
    """How often messages were held up and came at once."""
    held: int = 0
    """For how long at most they were held up."""
    held_up: Sequence[tuple[int, int]] = ()
    """From when to when they were held up, each time."""
    fell_by: int | None = None
    """By how much its stamps last jumped backwards."""
    fell_at: int | None = None
    """When they did."""
    stepped: Step | None = None
    """The last lasting step of its stamps against the times of receipt."""
    delay_before: int | None = None
    """The least delay of its messages before its clock was set, None where that was not seen."""
    may_step: bool = False
    """Whether its last stamps may have stepped, which is not known yet."""
    swings: int = 0
    """How often its stamps stepped there and back."""
    swung_by: int = 0
    """How far they did."""

    # Worked out when they are asked for, which is not at every look.

    @property
    def last_received(self) -> int | None:
        """When the last message came, None before the first."""
        return self.received[-1] if self.received else None

    @property
    def gaps(self) -> Sequence[int]:
        """The times between two of the last messages."""
        return _steps(self.received)

    @property
    def longest_pause(self) -> int:
        """The longest of them."""
        return max(self.gaps, default=0)

    @property
    def delay(self) -> int | None:
        """The median of the delays, None while all stamps are 0."""
        return Distribution(self.delays).quantile(0.5) if self.delays else None

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


@dataclass(slots=True)  # frozen, it would cost three times as much to make, at each look
class GroupFigures:
    """A group; times and durations in nanoseconds. `Observation.figures` fills it in."""

    now: int
    """The time of this moment."""
    began: int
    """When it began to be observed."""
    sets: int = 0
    """How many sets left in all."""
    rate_hz: float = 0.0
    """The sets a second, over the window."""
    best_hz: float = 0.0
    """The rate of the input, or of the clock, that sets the pace: no more sets are possible."""
    last_set: int | None = None
    """When the last set left."""
    left_at: Sequence[int] = ()
    """When sets were last seen to have left, look by look."""
    resumed: int | None = None
    """When the first set left after a silence."""
    share: Share = NOT_KNOWN
    """How many of the possible sets left."""
    shares: Shares = field(default=lambda _: NOT_KNOWN, compare=False, repr=False)
    """How many did since a time, as long as that is within the time of `share`."""
    span_histogram: Histogram = EMPTY
    """The spans of all sets, counted."""
    latency_histogram: Histogram = EMPTY
    """The latencies of all sets, counted."""
    spans: Distribution = NOTHING
    """The spans of the last sets."""
    latencies: Distribution = NOTHING
    """The latencies of the last sets."""
    nearest: Distribution = NOTHING
    """The span of the tightest set of each of the last messages of the input that sets the pace."""
    nearest_lately: Distribution = NOTHING
    """Those of the window, and no fewer than 20 where there are."""
    nearest_since: Distribution = NOTHING
    """Those of them that were measured after the last set."""
    nearest_from: int = 0
    """Since when `nearest` is measured: at the latest since an input changed its pace or its clock."""
    nearest_at: Sequence[int] = ()
    """When each of `nearest` was measured."""
    hindered_until: int = 0
    """Until when a known cause kept sets from leaving: `nearest` is measured from then on."""
    missing: tuple[float, ...] = ()
    """The share, 0 to 1, of the window's sets that each input is missing from."""
    sets_since_without: tuple[int, ...] = ()
    """How many sets there were since the last one without each input."""

    def measured_since(self, at: int) -> "GroupFigures":
        """Return the same without the spans that were measured until then."""
        old = bisect_right(self.nearest_at, at)
        if not old:
            return replace(self, hindered_until=at)
        kept, lately = len(self.nearest) - old, len(self.nearest_lately)
        nearest = Distribution(self.nearest.newest(kept)[::-1])
        return replace(
            self,
            nearest=nearest,
            nearest_lately=nearest if kept < lately else self.nearest_lately,
            nearest_since=Distribution(self.nearest_since.newest(min(kept, len(self.nearest_since)))[::-1]),
            nearest_from=self.nearest_at[old] if kept else self.now,
            nearest_at=self.nearest_at[old:],
            hindered_until=at,
        )

    @property
    def last_sets(self) -> tuple[tuple[int, int], ...]:
        """Spans and latencies of the last sets, the newest first."""
        return tuple(zip(self.spans.newest(_SHOWN_SETS), self.latencies.newest(_SHOWN_SETS), strict=True))
