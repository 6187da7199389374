"""What is seen of a group over its last seconds: rates, spans, latencies, delays, misses; fed once a second or so."""

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise
from statistics import median
from typing import Final, NamedTuple, TypeAlias

from syncrelay.explain.distribution import NOTHING, Distribution
from syncrelay.explain.drift import Drift, drift
from syncrelay.explain.histogram import EMPTY, Histogram, Tallied
from syncrelay.explain.nearest import NearestSpans
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.messages import DropReason

Arrivals: TypeAlias = Sequence[tuple[int, int]]
"""Stamps and times of receipt of one input's messages as they came, in nanoseconds."""
SentSets: TypeAlias = Sequence[tuple[tuple[int | None, ...], int]]
"""Stamps of each set in input order, None where one was missing, and the set's latency, in nanoseconds."""

WINDOW_NS: Final = 10_000_000_000
"""Rates, drops and faults are those of about this long."""
_SECOND: Final = 1_000_000_000
# A fall by more is a jump, as for the engine.
_JUMP_NS: Final = 1_000_000_000
_SILENT_NS: Final = 5_000_000_000
_SILENT_PERIODS: Final = 5
_LAST_SETS: Final = 500
_SHOWN_SETS: Final = 100
_LAST_MESSAGES: Final = 200
# Of a slow input, so many messages tell the rate, however long ago they came.
_RATE_FROM: Final = 5
_DRIFT_POINTS: Final = 600
# It costs more than all the rest, and changes slowly.
_DRIFT_EVERY: Final = 5


@dataclass(frozen=True, slots=True)
class InputFigures:
    """One input; times and durations in nanoseconds, counts over the window.

    `usual_hz` is the rate of the last messages while they came, `delay` the median of time of receipt minus stamp,
    `jitter` the 95th percentile of how far the time between two stamps is off its median. `fell_by` and `fell_at`
    tell of the last backward jump of its stamps.
    """

    rate_hz: float = 0.0
    usual_hz: float = 0.0
    fed: int = 0
    dropped: Mapping[DropReason, int] = field(default_factory=dict)
    last_stamp: int | None = None
    last_received: int | None = None
    delay: int | None = None
    jitter: int | None = None
    drift: Drift | None = None
    duplicates: int = 0
    out_of_order: int = 0
    fell_by: int | None = None
    fell_at: int | None = None


@dataclass(frozen=True, slots=True)
class GroupFigures:
    """A group. `best_hz` is the rate of the slowest required input: no more sets are possible.

    `last_sets` are spans and latencies, the newest first.

    `nearest` holds the span of the tightest set that each message of the slowest input could have had; `missing` is
    the share of the window's sets, 0 to 1, that each input was missing from.
    """

    now: int
    began: int
    sets: int = 0
    rate_hz: float = 0.0
    best_hz: float = 0.0
    last_set: int | None = None
    last_sets: tuple[tuple[int, int], ...] = ()
    span_histogram: Histogram = EMPTY
    latency_histogram: Histogram = EMPTY
    spans: Distribution = NOTHING
    latencies: Distribution = NOTHING
    nearest: Distribution = NOTHING
    missing: tuple[float, ...] = ()


class Observation:
    """Gathers what came and left of one group.

    `offsets_ns` are added to stamps as for matching; `trigger` as for NearestSpans. All times are of one clock, that
    of `began` and of the times of receipt.
    """

    def __init__(
        self, *, offsets_ns: Sequence[int], required: Sequence[bool], began: int, trigger: int | None = None
    ) -> None:
        self._began = began
        self._offsets = tuple(offsets_ns)
        self._required = [index for index, needed in enumerate(required) if needed]
        self._trigger = trigger
        self._inputs = [_Input() for _ in offsets_ns]
        self._looks: deque[_Look] = deque()
        self._span_histogram, self._latency_histogram = Tallied(), Tallied()
        self._sets: deque[_Set] = deque(maxlen=_LAST_SETS)
        self._nearest_spans = NearestSpans(
            len(self._required), trigger=None if trigger is None else self._required.index(trigger)
        )
        self._nearest: deque[int] = deque(maxlen=_LAST_SETS)

    def add(
        self, arrivals: Sequence[Arrivals], sets: SentSets, counts: Sequence[InputCounts], total_sets: int, *, now: int
    ) -> None:
        """Take what came and left since the last call, and the engine's counts as they are now."""
        fallen = [each.add(new) for each, new in zip(self._inputs, arrivals, strict=True)]
        if any(fallen):
            self._nearest_spans.clear()
        elif len(self._required) > 1:
            shifted = [[stamp + self._offsets[index] for stamp, _ in arrivals[index]] for index in self._required]
            self._nearest.extend(self._nearest_spans.add(shifted))
        for stamps, latency in sets:
            span = self._span(stamps)
            self._sets.append(_Set(now, stamps, span, latency))
            self._span_histogram.add(span)
            self._latency_histogram.add(latency)
        self._looks.append(_Look(now, tuple(counts), total_sets))
        while len(self._looks) > 1 and self._looks[1].at <= now - WINDOW_NS:
            self._looks.popleft()

    def figures(self, *, now: int) -> tuple[GroupFigures, tuple[InputFigures, ...]]:
        """Give what is known now, of the group and of its inputs in order."""
        inputs = tuple(self._input_figures(index, now) for index in range(len(self._inputs)))
        counted = self._required if self._trigger is None else [self._trigger]
        recent = [each.stamps for each in self._sets if each.at > now - WINDOW_NS]
        first, last = (self._looks[0], self._looks[-1]) if self._looks else (None, None)
        group = GroupFigures(
            now=now,
            began=self._began,
            sets=last.sets if last else 0,
            rate_hz=(last.sets - first.sets) * _SECOND / max(1, last.at - first.at) if first and last else 0.0,
            best_hz=min(inputs[index].rate_hz for index in counted),
            last_set=self._sets[-1].at if self._sets else None,
            last_sets=tuple((each.span, each.latency) for each in islice(reversed(self._sets), _SHOWN_SETS)),
            span_histogram=self._span_histogram.histogram(),
            latency_histogram=self._latency_histogram.histogram(),
            spans=Distribution(each.span for each in self._sets),
            latencies=Distribution(each.latency for each in self._sets),
            nearest=Distribution(self._nearest),
            missing=tuple(
                sum(stamps[index] is None for stamps in recent) / max(1, len(recent))
                for index in range(len(self._inputs))
            ),
        )
        return group, inputs

    def _span(self, stamps: Sequence[int | None]) -> int:
        shifted = [stamp + offset for stamp, offset in zip(stamps, self._offsets, strict=True) if stamp is not None]
        return max(shifted) - min(shifted)

    def _input_figures(self, index: int, now: int) -> InputFigures:
        if not self._looks:
            return InputFigures()
        before, after = self._looks[0].counts[index], self._looks[-1].counts[index]
        gone = Counter(after.dropped)
        gone.subtract(before.dropped)
        seconds = (self._looks[-1].at - self._looks[0].at) / _SECOND
        return self._inputs[index].figures(
            fed=after.fed - before.fed, dropped={reason: n for reason, n in gone.items() if n}, seconds=seconds, now=now
        )


class _Set(NamedTuple):
    at: int
    stamps: tuple[int | None, ...]
    span: int
    latency: int


class _Look(NamedTuple):
    at: int
    counts: tuple[InputCounts, ...]
    sets: int


class _Input:
    """The last messages of an input."""

    def __init__(self) -> None:
        self._last: deque[tuple[int, int]] = deque(maxlen=_LAST_MESSAGES)
        self._faults: deque[tuple[int, int, int]] = deque()
        self._points: deque[tuple[int, int]] = deque(maxlen=_DRIFT_POINTS)
        self._drift: Drift | None = None
        self._points_seen = 0
        self._newest: int | None = None
        self._fell: tuple[int, int] | None = None

    def add(self, arrivals: Arrivals) -> bool:
        """Take what came; whether its stamps have fallen back by more than a second."""
        if not arrivals:
            return False
        fallen = False
        duplicates = out_of_order = 0
        newest = self._newest
        for stamp, received in arrivals:
            if newest is None or stamp > newest:
                newest = stamp
            elif stamp == newest:
                duplicates += 1
            elif stamp and stamp < newest - _JUMP_NS:
                self._fell = (newest - stamp, received)
                newest, fallen = stamp, True
            else:
                out_of_order += stamp != 0
        self._newest = newest
        if fallen:
            self._points.clear()
            self._last.clear()
        self._last.extend(arrivals)
        received = arrivals[-1][1]
        self._faults.append((received, duplicates if newest else 0, out_of_order))
        while self._faults[0][0] <= received - WINDOW_NS:
            self._faults.popleft()
        self._points.append(_point(arrivals))
        self._points_seen += 1
        if self._points_seen % _DRIFT_EVERY == 0:
            self._drift = drift(self._points)
        return fallen

    def figures(self, *, fed: int, dropped: Mapping[DropReason, int], seconds: float, now: int) -> InputFigures:
        """Give the figures; counts are those of the window."""
        fell_by, fell_at = self._fell or (None, None)
        rate_hz, usual_hz = self._rates(fed, seconds, now)
        faults = [each for each in self._faults if each[0] > now - WINDOW_NS]
        return InputFigures(
            rate_hz=rate_hz,
            usual_hz=usual_hz,
            fed=fed,
            dropped=dropped,
            last_stamp=self._last[-1][0] if self._last else None,
            last_received=self._last[-1][1] if self._last else None,
            delay=round(median(received - stamp for stamp, received in self._last)) if self._last else None,
            jitter=self._jitter(),
            drift=self._drift,
            duplicates=sum(each[1] for each in faults),
            out_of_order=sum(each[2] for each in faults),
            fell_by=fell_by,
            fell_at=fell_at,
        )

    def _rates(self, fed: int, seconds: float, now: int) -> tuple[float, float]:
        """Give messages a second, of the window or of the last few where it held fewer, and while they came."""
        times = [received for _, received in self._last]
        if len(times) < 2 or times[-1] <= times[0]:  # noqa: PLR2004  two make a period
            return 0.0, 0.0
        usual = (len(times) - 1) * _SECOND / (times[-1] - times[0])
        if (now - times[-1]) * usual > _SILENT_PERIODS * _SECOND and now - times[-1] > _SILENT_NS:
            return 0.0, usual
        return (fed / seconds if fed >= _RATE_FROM and seconds > 0 else usual), usual

    def _jitter(self) -> int | None:
        periods = [after - before for (before, _), (after, _) in pairwise(self._last)]
        if not periods:
            return None
        usual = median(periods)
        return Distribution(round(abs(period - usual)) for period in periods).quantile(0.95)


def _point(arrivals: Arrivals) -> tuple[int, int]:
    """Give one point for all that came: the middle of their times, and their usual delay."""
    delay = round(median(received - stamp for stamp, received in arrivals))
    return (arrivals[0][1] + arrivals[-1][1]) // 2, delay
