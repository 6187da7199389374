"""Sums over recordings that can be added to each other in any order, and give the same whatever the order."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import ceil
from typing import Final, Self

from syncrelay.recordings.analysis.buckets import floor_of, middle_of
from syncrelay.recordings.fleet.suggestions import Values

WHOLE_PPM: Final = 1_000_000
"""A share is a whole number of millionths: sums of these do not depend on the order, as those of floats do."""


@dataclass(frozen=True, slots=True)
class Quantiles:
    """A quantity in nanoseconds. Median and 95th percentile are within a sixteenth, the greatest is exact."""

    median: int
    high: int
    greatest: int


@dataclass(slots=True)
class Buckets:
    """How often a quantity was in which bucket, and its bounds."""

    counts: Counter[int] = field(default_factory=Counter)
    least: int = 0
    greatest: int = 0

    def count(self, counts: Mapping[int, int], least: int, greatest: int) -> None:
        """Add counts by the floors of buckets, and the bounds of what they count."""
        self.least = min(self.least, least) if self.counts else least
        self.greatest = max(self.greatest, greatest) if self.counts else greatest
        # As Counter.update, which asks first what it is given, and takes twice as long.
        own = self.counts
        for floor, count in counts.items():
            own[floor] = own.get(floor, 0) + count

    def add(self, other: Self) -> None:
        """Add counts."""
        # Of an empty one the bounds mean nothing.
        if other.counts:
            self.count(other.counts, other.least, other.greatest)

    def count_one(self, value: int, *, least: int, greatest: int) -> None:
        """Add one value that stands for many, and the bounds of these."""
        self.count({floor_of(value): 1}, least, greatest)

    def quantiles(self) -> Quantiles | None:
        """Return the quantiles; None where nothing was counted."""
        if not self.counts:
            return None
        return Quantiles(self._quantile(0.5), self._quantile(0.95), self.greatest)

    def _quantile(self, share: float) -> int:
        left = ceil(share * self.counts.total())
        for floor in sorted(self.counts):
            left -= self.counts[floor]
            if left <= 0:
                return min(max(middle_of(floor), self.least), self.greatest)
        return self.greatest


@dataclass(frozen=True, slots=True, order=True)
class Drift:
    """How much slower than the recorder's clock the stamps of a topic run, in which recording; ordered by how far."""

    size: float
    ppm: float
    topic: str
    recording: str


@dataclass(slots=True)
class Tally:
    """What recordings, or a group or a topic of each, add up to; Figures says what it all means."""

    recordings: int = 0
    lasts: int = 0
    judged: int = 0
    without: int = 0
    rated: int = 0
    rate_ppm: int = 0
    sets: int = 0
    now: int = 0
    possible: int = 0
    span: Buckets = field(default_factory=Buckets)
    latency: Buckets = field(default_factory=Buckets)
    received: int = 0
    matched: int = 0
    unneeded: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    gaps: int = 0
    longest_gap: int = 0
    other_clock: int = 0
    drift: Drift | None = None
    codes: Counter[str] = field(default_factory=Counter)
    values: Values = field(default_factory=Values)

    def add(self, other: Self) -> None:
        """Add counts."""
        for name in _SUMS:
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in _COUNTERS:
            if found := getattr(other, name):
                getattr(self, name).update(found)
        self.span.add(other.span)
        self.latency.add(other.latency)
        self.values.add(other.values)
        self.longest_gap = max(self.longest_gap, other.longest_gap)
        self.drift = max(filter(None, (self.drift, other.drift)), default=None)

    def rate(self, ppm: int | None) -> None:
        """Take a share of 1 in millionths into the mean; None where it cannot be known."""
        if ppm is not None:
            self.rated += 1
            self.rate_ppm += ppm


_SUMS: Final = (
    "recordings",
    "lasts",
    "judged",
    "without",
    "rated",
    "rate_ppm",
    "sets",
    "now",
    "possible",
    "received",
    "matched",
    "unneeded",
    "gaps",
    "other_clock",
)
_COUNTERS: Final = ("dropped", "faults", "codes")
