"""What is seen of a group over its last seconds: rates, spans, latencies, delays, misses; fed every second or few."""

from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Sequence
from itertools import repeat
from operator import add, sub
from typing import Any, Final, NamedTuple, TypeAlias

from syncrelay.config import Distance, GroupConfig
from syncrelay.explain.distribution import Distribution, Tallied, keep_last, no_values
from syncrelay.explain.figures import GroupFigures, InputFigures
from syncrelay.explain.input_observation import Arrivals, InputObservation
from syncrelay.explain.nearest import NearestSpans
from syncrelay.explain.order import WINDOW_NS
from syncrelay.explain.standing import ShareWindow
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.messages import DropReason

SentSets: TypeAlias = Sequence[tuple[tuple[int | None, ...], int]]
"""Stamps of each set in input order, None where one was missing, and the set's latency, in nanoseconds."""

_SECOND: Final = 1_000_000_000
_LAST_SETS: Final = 500
_FAULTY: Final = (DropReason.MALFORMED, DropReason.UNSTAMPED)
_LAST_LOOKS: Final = 60
_SILENCE: Final = 5 * _SECOND
# Keep at least this many of a slow input's last messages, however old they are.
_NEAREST_WINDOW: Final = 60 * _SECOND
_FEWEST_NEAREST: Final = 20
# An input whose period is below this share of the longest does not set the pace.
_AS_SLOW: Final = 0.7
# An input that more sets than these lack is not one of those that make them.
_MOST: Final = 0.5


class Observation:
    """Gathers what came and left of one group; all times are of one clock, that of `began` and of times of receipt."""

    def __init__(self, config: GroupConfig, *, began: int) -> None:
        options = config.options
        self._began = began
        self._offsets = tuple(topic.offset_ns for topic in config.topics)
        self._config = config
        self._has_choice = config.quorum > len(config.required)
        self._trigger = config.trigger
        self._ticks_hz = None if config.ticks is None else config.ticks.hz
        self.inputs = [InputObservation() for _ in config.topics]
        nothing = tuple(InputCounts(fed=0, matched=0, dropped={}, buffered=0) for _ in config.topics)
        self._polls = deque([_Poll(began, nothing, 0, 0, (0,) * len(nothing))])
        self._share = ShareWindow(
            config.enough,
            trigger=self._trigger,
            ticks_hz=self._ticks_hz,
            every=options.every,
            least_period=options.max_rate,
        )
        self._span_histogram, self._latency_histogram = Tallied(), Tallied()
        self._last_set: int | None = None
        self._left_at = no_values()
        self._resumed: int | None = None
        self._spans, self._latencies = no_values(), no_values()
        self._need(config.enough([each.fed for each in nothing]))
        self._nearest, self._nearest_at, self._nearest_since = no_values(), no_values(), no_values()
        self._measured_at = began
        self._changed_at = began
        self._sets_since_without = [0] * len(self.inputs)

    def add(
        self,
        arrivals: Sequence[Arrivals],
        sets: SentSets,
        counts: Sequence[InputCounts],
        total_sets: int,
        *,
        by_clock: Callable[[int], int] | None = None,
        now: int,
    ) -> None:
        """Take what came and left since the last call, and the engine's counts as they are now."""
        if self._polls and now < self._polls[-1].at:
            self._begin_anew(now)
        stamps = list(zip(*(stamps for stamps, _ in sets), strict=True)) or [()] * len(self.inputs)
        missing = tuple([each.count(None) for each in stamps])
        self._polls.append(_Poll(now, tuple(counts), total_sets, len(sets), missing))
        if len(self.needed) < len(self.inputs):
            self._sets_since_without = list(map(_since_without, self._sets_since_without, stamps))
        while len(self._polls) > 1 and self._polls[1].at <= now - WINDOW_NS:
            self._polls.popleft()
        fallen = [each.add(new, by_clock=by_clock) for each, new in zip(self.inputs, arrivals, strict=True)]
        self._follow_needed(now)
        clock = None if by_clock is None else by_clock(now)
        self._share.add(counts, total_sets, [each.pace for each in self.inputs], now=now, clock=clock)
        self._measure_nearest(arrivals, now, has_jumped=any(fallen))
        changed_at = max(each.changed_at for each in self.inputs)
        if changed_at > self._changed_at:
            # What was measured before says nothing of how it is now.
            self._changed_at = changed_at
            self._forget_nearest(until=changed_at)
        if sets:
            spans = [self._span(stamps) for stamps, _ in sets] if any(missing) else self._spans_of_whole(stamps)
            self._take_sets(spans, [latency for _, latency in sets], now)

    def figures(self, *, now: int) -> tuple[GroupFigures, tuple[InputFigures, ...]]:
        """Give what is known now, of the group and of its inputs in order."""
        inputs = tuple(self._input_figures(index, now) for index in range(len(self.inputs)))
        counted = self.needed if self._trigger is None else (self._trigger,)
        group = GroupFigures(
            now=now,
            began=self._began,
            sets=self._polls[-1].sets if self._polls else 0,
            rate_hz=self._rate_hz(),
            best_hz=self._ticks_hz or min(inputs[index].rate_hz for index in counted),
            last_set=self._last_set,
            left_at=self._left_at[:],
            resumed=self._resumed,
            share=self._share.share(),
            shares=self._share.shares(),
            span_histogram=self._span_histogram.histogram(),
            latency_histogram=self._latency_histogram.histogram(),
            spans=Distribution(self._spans[:]),
            latencies=Distribution(self._latencies[:]),
            nearest=Distribution(self._nearest[:]),
            nearest_lately=Distribution(self._nearest[self._lately(now) :]),
            nearest_since=Distribution(self._nearest_since[:]),
            nearest_from=self._nearest_at[0] if self._nearest_at else now,
            nearest_at=self._nearest_at[:],
            missing=self._missing(now),
            sets_since_without=tuple(self._sets_since_without),
        )
        return group, inputs

    def _lately(self, now: int) -> int:
        return bisect_left(self._nearest_at, now - WINDOW_NS, 0, max(0, len(self._nearest_at) - _FEWEST_NEAREST))

    def begin_again(self, at: int) -> None:
        """Bear that nothing was fed for a while, until now: what came before tells nothing. What left is kept."""
        self._began, self._last_set, self._resumed = at, None, None
        del self._left_at[:]
        self._polls = deque(poll._replace(at=at, sent=0) for poll in [*self._polls][-1:])
        self.inputs = [InputObservation() for _ in self.inputs]
        self._share.clear()
        self._changed_at = at
        self._sets_since_without = [0] * len(self.inputs)
        self._forget_nearest()
        self._clear_nearest_spans()

    def begin_sets_anew(self, now: int) -> None:
        """Bear that sets may leave again, which could not: their rate is that from now on."""
        self._resumed = now

    def recent(self) -> Sequence[Arrivals]:
        """Give the last messages of each input that have stamps, to try values on."""
        return [each.recent() for each in self.inputs]

    def _need(self, needed: tuple[int, ...]) -> None:
        """Have these be the inputs without which no set leaves, and measure how near they and the others come."""
        distance = self._config.options.distance
        self.needed = needed
        # How near those with a tolerance of their own are is not measured.
        self._measured = [index for index in needed if self._config.own_tolerances[index] is None]
        self._nearest_spans = NearestSpans(len(self._measured), distance)
        self._with_optional = {
            index: NearestSpans(len(needed) + 1)
            for index in range(len(self.inputs))
            if index not in needed and distance is Distance.SPAN
        }

    def _follow_needed(self, now: int) -> None:
        """With a quorum, inputs that come are needed, those in sets first. If too few come, the others all are."""
        if not self._has_choice:
            return
        missing = self._missing(now)
        coming = [each.is_coming(now) for each in self.inputs]
        needed = self._config.enough(
            [2 * comes - (lacks > _MOST) for comes, lacks in zip(coming, missing, strict=True)]
        )
        if not all(coming[index] for index in needed):
            needed = tuple(index for index in range(len(coming)) if index in needed or not coming[index])
        if needed != self.needed:
            self._need(needed)
            self._forget_nearest()

    def _begin_anew(self, now: int) -> None:
        """Forget what lies in the future after this machine's clock was set back: it would count forever."""
        self._polls.clear()
        self._share.clear()
        self._forget_nearest()
        self._began = min(self._began, now)
        self._last_set = None if self._last_set is None else now
        del self._left_at[:]
        self._resumed = None if self._resumed is None else now

    def _forget_nearest(self, until: int | None = None) -> None:
        old = len(self._nearest_at) if until is None else bisect_left(self._nearest_at, until)
        del self._nearest[:old], self._nearest_at[:old]
        del self._nearest_since[: max(0, len(self._nearest_since) - len(self._nearest))]

    def _clear_nearest_spans(self) -> None:
        for spans in (self._nearest_spans, *self._with_optional.values()):
            spans.clear()

    def _measure_nearest(self, arrivals: Sequence[Arrivals], now: int, *, has_jumped: bool) -> None:
        if has_jumped:
            del self._nearest_since[:]
            self._clear_nearest_spans()
            return
        shifted = [
            [stamp + offset for stamp, _ in came if stamp] for came, offset in zip(arrivals, self._offsets, strict=True)
        ]
        if len(self._measured) > 1 and self._ticks_hz is None:
            pivot = self._slowest(self._measured) if self._trigger is None else self._trigger
            measured = self._nearest_spans.add(
                [shifted[index] for index in self._measured], pivot=self._measured.index(pivot)
            )
            keep_last(self._nearest, measured, _LAST_SETS)
            # They may have waited for a partner that was silent: they came after the last that were measured.
            keep_last(self._nearest_at, [self._measured_at] * len(measured), _LAST_SETS)
            if measured:
                self._measured_at = now
            a_while_ago, surplus = now - _NEAREST_WINDOW, max(0, len(self._nearest_at) - _FEWEST_NEAREST)
            old = bisect_left(self._nearest_at, a_while_ago, 0, surplus)
            del self._nearest[:old], self._nearest_at[:old]
            keep_last(self._nearest_since, measured, _LAST_SETS)
        for optional, spans in self._with_optional.items():
            among = [*self.needed, optional]
            pivot = among.index(self._slowest(among))
            self.inputs[optional].add_nearest(spans.add([shifted[index] for index in among], pivot=pivot))

    def _slowest(self, among: Sequence[int]) -> int:
        """Give the input of these of which the fewest came in the window, of those that do not come faster by far."""
        # Few came of one that has just begun, or is back, however fast it comes.
        periods = {index: self.inputs[index].period for index in among}
        longest = max(periods.values())
        among = [index for index, period in periods.items() if not period or period > _AS_SLOW * longest]
        last = self._polls[-1].counts
        before = [each.fed for each in self._polls[0].counts] if len(self._polls) > 1 else [0] * len(last)
        return min(among, key=lambda index: last[index].fed - before[index])

    def _take_sets(self, spans: Sequence[int], latencies: Sequence[int], now: int) -> None:
        # Two polls may be as far apart as a silence is long.
        saw_none_before = len(self._polls) > 1 and not self._polls[-2].sent
        if self._last_set is None or (now - self._last_set >= _SILENCE and saw_none_before):
            self._resumed = now
        self._last_set = now
        keep_last(self._left_at, [now], _LAST_LOOKS)
        del self._nearest_since[:]
        keep_last(self._spans, spans, _LAST_SETS)
        keep_last(self._latencies, latencies, _LAST_SETS)
        self._span_histogram.add(spans)
        self._latency_histogram.add(latencies)

    def _spans_of_whole(self, stamps: Sequence[Sequence[Any]]) -> list[int]:
        """Measure sets that miss none, input by input: at a quarter of the cost."""
        shifted = [
            list(map(add, each, repeat(offset))) if offset else each
            for each, offset in zip(stamps, self._offsets, strict=True)
        ]
        return list(map(sub, map(max, zip(*shifted, strict=True)), map(min, zip(*shifted, strict=True))))

    def _span(self, stamps: Sequence[int | None]) -> int:
        there = [stamp + offset for stamp, offset in zip(stamps, self._offsets, strict=True) if stamp is not None]
        return max(there) - min(there)

    def _rate_hz(self) -> float:
        if not self._polls:
            return 0.0
        first, last = self._polls[0], self._polls[-1]
        if self._resumed is not None and first.at < self._resumed < last.at:
            first = next(poll for poll in self._polls if poll.at >= self._resumed)
        return (last.sets - first.sets) * _SECOND / max(1, last.at - first.at)

    def _missing(self, now: int) -> tuple[float, ...]:
        if len(self.needed) == len(self.inputs):
            return (0.0,) * len(self.inputs)
        recent = [poll for poll in self._polls if poll.at > now - WINDOW_NS]
        sent = max(1, sum(poll.sent for poll in recent))
        return tuple(sum(poll.missing[index] for poll in recent) / sent for index in range(len(self.inputs)))

    def _input_figures(self, index: int, now: int) -> InputFigures:
        if not self._polls:
            return InputFigures()
        before, after = self._polls[0].counts[index], self._polls[-1].counts[index]
        gone = {reason: count - before.dropped.get(reason, 0) for reason, count in after.dropped.items()}
        seconds = (self._polls[-1].at - self._polls[0].at) / _SECOND
        dropped = {reason: n for reason, n in gone.items() if n}
        return self.inputs[index].figures(
            fed=after.fed - before.fed,
            dropped=dropped,
            last_faults={reason: self._last_drop(index, reason) for reason in _FAULTY if reason in dropped},
            seconds=seconds,
            now=now,
        )

    def _last_drop(self, index: int, reason: DropReason) -> int:
        """Return when an input's last drop for a reason was seen."""
        count = self._polls[-1].counts[index].dropped[reason]
        return next(each.at for each in self._polls if each.counts[index].dropped.get(reason, 0) == count)


def _since_without(before: int, stamps: Sequence[int | None]) -> int:
    """Count on how many sets there were since the last one without an input, whose stamps in the new sets these are."""
    last = next((count for count, stamp in enumerate(reversed(stamps)) if stamp is None), None)
    return before + len(stamps) if last is None else last


class _Poll(NamedTuple):
    """What there was at one call: the counts until then, and of the sets that left since the one before."""

    at: int
    counts: tuple[InputCounts, ...]
    sets: int
    sent: int
    missing: tuple[int, ...]
