"""Which values of the file would give more sets: the engine itself tries them on the messages that were received.

One `Trials` answers all questions about a group and a moment, so that a key has one value in every view of it. What
is counted is sets of one moment: a wider slop that pairs messages of two moments gives more sets, and cures nothing.
"""

from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, combinations
from math import ceil
from typing import Any, Final, NamedTuple

import numpy as np

from syncrelay.config import Distance, GroupConfig
from syncrelay.config.units import parse_duration
from syncrelay.explain import words
from syncrelay.explain.changes import Change, Changes, changed, offset_change
from syncrelay.explain.epochs import time_scale, usual_delay
from syncrelay.explain.nearest import (
    LONGEST,
    Nanoseconds,
    in_order,
    period_of,
    quantile,
    shifted,
    signed_distances,
)
from syncrelay.explain.possible_sets import PossibleSets, possible_sets
from syncrelay.explain.received import InOrder, Messages, Received, stretches
from syncrelay.explain.rows import Column, Rows, Stretches, extent, median, no_numbers, quantiles
from syncrelay.explain.set_spans import NOTHING, Run, counted, match, of_one_moment
from syncrelay.explain.widths import are_amid, tolerances, wander, with_headroom
from syncrelay.sync.queues import LONGEST_QUEUE

# Fewer possible sets are no evidence.
_FEWEST: Final = 5
# Values are good if they give all possible sets but one, or but this share: the ends of a window cut more sets off.
_LEFT_OUT_OF_WINDOW: Final = 0.05
_LEFT_OUT: Final = 0.01
_HEADROOM: Final = 1.25
_MOST_QUEUE: Final = 4
# A tolerance this many times what is needed pairs messages of two moments as soon as one is missing.
_TOO_WIDE: Final = 4
# Less cannot be distinguished from what a driver takes.
_LEAST_DISTANCE: Final = 1_000_000
# Messages of one moment are received within this share of a period.
_SAME: Final = 0.15
_SAME_RATE: Final = 0.05

REQUIRED: Final = None
"""Stands for the sets of the required inputs, where an index stands for those with that optional input."""


@dataclass(frozen=True, slots=True)
class Tried:
    """What changes would give: `given` of the `possible` sets of one moment, in place of `now`."""

    changes: Changes
    given: int
    now: int
    possible: int


class Verdict(NamedTuple):
    """The values that help, if any; and whether the file's values may miss sets at all.

    It is open where values give sets, and nothing shows which messages belong together.
    """

    tried: tuple[Tried, ...]
    may_miss: bool = True
    is_open: bool = False


UNTRIED: Final = Verdict(())


@dataclass(frozen=True)
class Trials:
    """Runs of a group's engine on the messages of its inputs.

    A window is of a live group: it ends where the next messages are still to come.
    """

    config: GroupConfig
    inputs: Sequence[Received]
    is_window: bool
    sets: Callable[[], Iterable[Nanoseconds]] | None = None
    """The sets that the group gives as it is, where they are known: a row a set, in which the stamps come first."""
    passed: Callable[[Iterable[Messages]], Iterable[Messages]] = iter
    """What passes the messages on to a run; it may end that by an exception."""
    kept: dict[Hashable, Any] = field(default_factory=dict)
    """What was found out of these messages, whatever the values of the file."""
    _targets: dict[int | None, PossibleSets | None] = field(default_factory=dict)
    _runs: dict[Changes, dict[int | None, Run]] = field(default_factory=dict)

    @property
    def runs(self) -> int:
        """How many runs there were."""
        return len(self._runs)

    @cached_property
    def optional(self) -> tuple[int, ...]:
        """The indices of the inputs that a set may lack."""
        return tuple(index for index in range(len(self.config.topics)) if index not in self._needed)

    @cached_property
    def required(self) -> tuple[int, ...]:
        """The required inputs that the group's tolerance is for; all required ones where each has its own."""
        required = self._needed
        own = self.config.own_tolerances
        shared = tuple(index for index in required if own[index] is None or index == self.config.trigger)
        return shared or required

    @cached_property
    def _needed(self) -> tuple[int, ...]:
        """The inputs whose sets are counted: the required ones, and up to a quorum those that send the most."""
        return self.config.enough([len(each.stamps) for each in self.inputs])

    def _target(self, target: int | None) -> int | None:
        """Return what is counted for a target: an input that was missing may be one of those that send the most."""
        return REQUIRED if target in self._needed else target

    def possible(self, target: int | None = REQUIRED) -> PossibleSets | None:
        """Return the sets of one moment that the required inputs allow, or those with an optional one."""
        target = self._target(target)
        if target not in self._targets:
            among = self.required if target is None else (*self.required, target)
            self._targets[target] = possible_sets(self.config, self.inputs, among, is_window=self.is_window)
        return self._targets[target]

    def spans(self, target: int | None = REQUIRED) -> Column:
        """Return the spans of the possible sets."""
        possible = self.possible(target)
        return no_numbers() if possible is None else possible.spans

    def given(self, changes: Changes, target: int | None = REQUIRED, *, within: int | None = None) -> int:
        """Return how many of the possible sets come together with changes; of those `within` a span, where one is."""
        run = self._run(changes).get(self._target(target), NOTHING)
        return counted(run.possible, within)

    def is_enough(self, changes: Changes, target: int | None = REQUIRED, *, within: int | None = None) -> bool:
        """Tell whether changes give nearly all possible sets."""
        possible = self._count(target, within)
        left_out = max(1, int((_LEFT_OUT_OF_WINDOW if self.is_window else _LEFT_OUT) * possible))
        return possible >= _FEWEST and self.given(changes, target, within=within) >= possible - left_out

    def _count(self, target: int | None, within: int | None) -> int:
        return counted(self.spans(target), within)

    def _run(self, changes: Changes) -> dict[int | None, Run]:
        if changes in self._runs:
            return self._runs[changes]
        config = changed(self.config, changes)
        # Thinning leaves sets out that came together.
        config = replace(config, options=config.options.model_copy(update={"every": 1, "max_rate": None}))
        possible = {
            target: each for target in (REQUIRED, *self.optional) if (each := self.possible(target)) is not None
        }
        # Of a long recording, the spans of many runs would need too much memory.
        found = {target: Rows(2, in_memory=0) for target in possible}

        def count(sets: Nanoseconds) -> None:
            for target, each in possible.items():
                found[target].append(of_one_moment(each, config, sets))

        if changes or self.sets is None:
            match(config, self.passed(stretches(self.inputs)), count)
        else:
            for sets in self.sets():
                count(sets)
        self._runs[changes] = {target: Run(rows.column(0), rows.column(1)) for target, rows in found.items()}
        return self._runs[changes]

    def spans_given(self, changes: Changes) -> Column:
        """Return the spans of the sets of one moment that come together with changes."""
        return self._run(changes).get(REQUIRED, NOTHING).given

    @cached_property
    def plan(self) -> Changes:
        """The values that fit the group: what cures the targets that miss sets, or a tolerance that is not too wide.

        Each later target is cured with the values of those before, which only grow: one value serves all.
        """
        chosen: Changes = ()
        for target in (REQUIRED, *self.optional):
            best, best_given = chosen, 0
            for cure in self._cures(target, chosen):
                within = None if any(each.key in self._widening for each in cure) else self._limit
                given = self.given(cure, target)
                # What is enough of the narrow sets may be less than a wider tolerance gives.
                if self.is_enough(cure, target, within=within) and given >= best_given:
                    best = cure
                    break
                if target is REQUIRED and given > max(best_given, self.given(())):
                    best, best_given = cure, given
            chosen = best
        return chosen or self._tidier()

    @property
    def _limit(self) -> int | None:
        tolerance = self.config.options.tolerance
        return None if tolerance is None else tolerance.ns

    @property
    def _widening(self) -> set[str]:
        """The keys that let wider sets leave."""
        tolerance = self.config.options.tolerance
        return set() if tolerance is None else {tolerance.key, "policy"} if tolerance.wider_policy else {tolerance.key}

    def _cures(self, target: int | None, chosen: Changes) -> Iterator[Changes]:
        """Yield values to try for a target that misses sets, the likeliest first, and each with longer queues."""
        possible = self.possible(target)
        if possible is None or len(possible) < _FEWEST or self.is_enough(chosen, target):
            return
        attempts = list(self._attempts(possible, target))
        for attempt in attempts:
            merged = self._merged(chosen, attempt)
            yield merged
            for size in self._queue_sizes(possible, merged):
                yield self._merged(merged, (Change("queue_size", str(size)),))

    def _attempts(self, possible: PossibleSets, target: int | None) -> Iterator[Changes]:
        options, tolerance = self.config.options, self.config.options.tolerance
        patient = ((Change("policy", options.patient_policy),),) if options.patient_policy else ()
        if possible.is_exact and target is REQUIRED:
            yield from self._exact()
        if tolerance is not None and quantile(possible.spans, 0.99) > tolerance.ns and not self.pairs_neighbours:
            policies: list[Changes] = [(Change("policy", tolerance.wider_policy),)] if tolerance.wider_policy else [()]
            # With headroom, some sets may lose messages to those that are nearly as near.
            for wider in dict.fromkeys(self._tolerances(possible)):
                yield from ((*policy, Change(tolerance.key, wider)) for policy in (*policies, *patient))
        if target is not REQUIRED and (late := self._lateness(target)) > 0:
            yield from _waits(late, 2 * late)
        yield ()
        if target is REQUIRED:
            yield from patient
            yield from _waits(2 * options.max_wait, 4 * options.max_wait) if options.max_wait else ()

    def _tolerances(self, possible: PossibleSets) -> Sequence[str]:
        if not self.is_window:
            # A whole recording shows how far apart they come. Live, nothing is offered where other sets are as near, as
            # one input may be stamped wrong. By that rule `init` would give no file for a camera and a lidar that are
            # 30 ms apart beside an IMU.
            return (with_headroom(possible.spans), words.at_least(possible.widest))
        return tolerances(possible, [self.stamps(each) for each in possible.among], self.config.options.distance)

    def stamps(self, index: int) -> Column:
        """Return an input's distinct stamps in order, offset added."""
        return self._in_order(index, self.config.topics[index].offset_ns).stamps

    def _in_order(self, index: int, offset: int) -> InOrder:
        return in_order(self.inputs[index], offset)

    def _exact(self) -> Iterator[Changes]:
        is_by_stamp = all(topic.stamp != "receive" for topic in self.config.topics)
        if is_by_stamp and self.config.options.policy != "exact_time" and self.config.options.distance is Distance.SPAN:
            yield (Change("policy", "exact_time"),)

    def _tidier(self) -> Changes:
        """Return a tolerance no wider than needed, where the file's is much wider and all sets come together.

        Not where stamps are mapped: how near they come is not the same after the next start.
        """
        possible, tolerance = self.possible(), self.config.options.tolerance
        if any(topic.is_of_device for topic in self.config.topics):
            return ()
        if possible is None or possible.is_alone or tolerance is None or not self.is_enough(()):
            return ()
        if possible.is_exact:
            tidier = next(self._exact(), ()) if tolerance.ns else ()
        elif tolerance.ns > _TOO_WIDE * possible.widest and self.config.options.distance is Distance.SPAN:
            wide = [self._tolerances(each) for each in map(self.possible, (REQUIRED, *self.optional)) if each]
            widest = max(parse_duration(each[0]) for each in wide) if all(wide) else tolerance.ns
            tidier = (Change(tolerance.key, words.at_least(widest)),) if widest < tolerance.ns else ()
        else:
            tidier = ()
        return tidier if tidier and self.is_enough(tidier) else ()

    def _merged(self, chosen: Changes, more: Changes) -> Changes:
        """Return changes with more of them; where both have a key, the greater value."""
        merged = {each.key: each for each in chosen}
        for each in more:
            before = merged.get(each.key)
            if before is None or each.key == "policy" or before.parsed < each.parsed:
                merged[each.key] = each
        return tuple(merged.values())

    def _queue_sizes(self, possible: PossibleSets, changes: Changes) -> Iterator[int]:
        """Yield ever longer queues: from what nearly all possible sets need, to some times as much."""
        need, current = quantile(possible.queues, 0.995), changed(self.config, changes).options.queue_size
        size, most = ceil(_HEADROOM * need) + 1, min(LONGEST_QUEUE, _MOST_QUEUE * max(need, current))
        while size <= most:
            if size > current:
                yield size
            size *= 2

    def _lateness(self, index: int) -> int:
        """Return how much later than the required inputs' an optional input's messages come, with headroom."""
        delays = [self._delays(other) for other in self.required]
        others, own = (
            [int(median(each)) for each in delays if extent(each)[0]],
            np.concatenate([*self._delays(index)()]),
        )
        return parse_duration(with_headroom(shifted(own, -min(others)))) if others and len(own) else 0

    def _delays(self, index: int) -> Stretches:
        """Return how long after its stamp, offset added, each message of an input came."""
        messages, offset = self.inputs[index], self.config.topics[index].offset_ns
        return lambda: (
            shifted(shifted(received, 0) - shifted(stamps, offset), 0) for stamps, received, _ in messages.stamped()
        )

    def _usual_delay(self, index: int) -> int | None:
        """Return how long after its stamp an input's message usually came; None where none has a stamp."""
        key = ("usual delay", index, self.config.topics[index].offset_ns)
        if key not in self.kept:
            delays = self._delays(index)
            self.kept[key] = quantiles(delays, [0.5])[0] if extent(delays)[0] else None
        delay: int | None = self.kept[key]
        return delay

    def verdict(self, target: int | None, keys: Collection[str], *, all_widths: bool = False) -> Verdict:
        """Return the fewest values of the plan, of these keys, that cure a target.

        The possible sets are those that the file's tolerance allows, or all where a key widens it or with `all_widths`.
        """
        tolerance = self.config.options.tolerance
        limit = None if all_widths or self._widening & set(keys) else self._limit
        now, possible = self.given((), target, within=limit), self._count(target, limit)
        sets = self.possible(target)
        is_certain = sets is not None and len(in_order(self.inputs[sets.pivot], 0).stamps) >= 2 * _FEWEST
        is_enough = self.is_enough((), target, within=limit)
        may_miss = not (is_certain and (possible < _FEWEST or is_enough))
        if is_enough or possible < _FEWEST:
            return Verdict((), may_miss)
        offered = [each for each in self.plan if each.key in keys]
        for some in chain.from_iterable(combinations(offered, count) for count in range(1, len(offered) + 1)):
            named = {each.key for each in some}
            if tolerance is not None and tolerance.wider_policy and "policy" in named and tolerance.key not in named:
                # The other policy cannot do without its tolerance.
                continue
            if self.is_enough(some, target, within=limit):
                return Verdict((Tried(some, self.given(some, target, within=limit), now, possible),), may_miss)
        return Verdict((), may_miss)

    @cached_property
    def pairs_neighbours(self) -> bool:
        """Whether the nearest stamps belong to messages of two moments: an offset would help, and no tolerance."""
        return any(is_other for _, is_other in self._constant_offsets())

    def offsets(self) -> Iterator[Change]:
        """Yield the offsets that bring the stamps of an input, a constant distance off, to those of the pivot."""
        if self.config.options.distance is Distance.SPAN:
            yield from (change for change, _ in self._constant_offsets())

    def _constant_offsets(self) -> Iterator[tuple[Change, bool]]:
        """Yield offsets, and whether an input of the pivot's rate has another partner than the nearest.

        The times of receipt say so: its messages come whole periods earlier or later than the pivot's nearest do.
        """
        possible = self.possible()
        if possible is None:
            return
        pivot = possible.pivot
        for index in possible.among:
            if index == pivot:
                continue
            one, other = self.stamps(pivot), self.stamps(index)
            distances = signed_distances(one, other)
            period = period_of(other)
            if len(distances) < _FEWEST or not period:
                continue
            middle = quantile(distances, 0.5)
            scatter = quantile(distances, 0.95) - quantile(distances, 0.05)
            if abs(middle) < _LEAST_DISTANCE or 2 * scatter > abs(middle):
                continue
            delays = [median(self._delays(at)) for at in (index, pivot)]
            whole = round((delays[0] - delays[1] + middle) / period) * period
            is_whole = bool(whole) and abs(delays[0] - delays[1] + middle - whole) <= _SAME * period
            shift = whole - middle if is_whole else -middle
            if not is_whole and (are_amid(one, other) or wander(one, other).in_a_minute > abs(middle) / 2):
                continue
            # Of two, the one that is farther from this machine's time is odd.
            at, shift = (index, shift) if abs(delays[0]) >= abs(delays[1]) else (pivot, -shift)
            is_same_rate = abs(period_of(one) / period - 1) <= _SAME_RATE
            if (change := offset_change(at, round(self.config.topics[at].offset_ns + shift))) is not None:
                yield change, is_whole and is_same_rate

    def moved(self, change: Change) -> "Trials":
        """Return trials of the same messages with another offset."""
        return replace(self, config=changed(self.config, (change,)), sets=None, _targets={}, _runs={})

    def by_offset(self, change: Change, target: int | None = REQUIRED) -> Tried | None:
        """Return what another offset gives if it brings messages together that are possible sets by then, else None."""
        moved = self.moved(change)
        if not moved.is_enough((), target):
            return None
        return Tried((change,), moved.given((), target), self.given((), target), len(moved.spans(target)))

    def clock_offset(self, index: int) -> Change | None:
        """Return the offset that brings an input of another clock to the time of the required inputs."""
        by = self.apart(index)
        if not by:
            return None
        exact = self.exactly_apart(index)
        return offset_change(index, (by if exact is None else exact) + self.config.topics[index].offset_ns)

    def exactly_apart(self, index: int) -> int | None:
        """Return by how much an input is behind the others if that is known by its time scale, else None."""
        by = self.apart(index)
        scale = time_scale(int(self.inputs[index].stamps[-1]), by) if by else None
        return None if scale is None else scale.behind

    def apart(self, index: int) -> int:
        """Return how much later after its stamp an input's message comes than the required ones' do; 0 if unknown."""
        usually = {at: self._usual_delay(at) for at in {*self._needed, index}}
        delays = {at: delay for at, delay in usually.items() if delay is not None}
        if index not in delays or len(delays) < 2:  # noqa: PLR2004  one alone has no other clock
            return 0
        return delays[index] - usual_delay(delays.values())


def _waits(*each: int) -> Iterator[Changes]:
    yield from ((Change("max_wait", words.at_least(wait)),) for wait in each if wait <= LONGEST)
