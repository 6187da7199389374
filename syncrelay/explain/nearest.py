"""Which messages are nearest to which, on arrays: the sets that there could be, whatever the slop and the queues."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, chain
from typing import Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from syncrelay.clock import UNREADABLE
from syncrelay.config import Distance, GroupConfig
from syncrelay.explain.rows import BLOCK, Column, Rows, blocks, median, quantiles, steps
from syncrelay.sync import Message
from syncrelay.sync.latest_at_ticks import REST_NS
from syncrelay.sync.ticks import Ticks

Nanoseconds: TypeAlias = npt.NDArray[np.int64]

# More than arrives between two polls at 1 kHz. Of an input whose partner is silent, no more are kept.
_KEPT: Final = 5_000
# Stands for "no message on this side". Twice this still fits into 64 bits.
_FAR: Final = 2**61
_LATEST: Final = 2**62 - 1
# Later than any stamp.
_NEVER: Final = 2**63
LONGEST: Final = _LATEST
"""No offset or wait longer than this, 146 years, is tried: as a duration of the file it might be out of range."""
# Stamps are meant to be equal if this share of them is. One that is not has lost its partner.
_EQUAL: Final = 0.8
# A set that spans more periods of its slowest input, or more times the usual span, pairs messages of two moments.
_PERIODS: Final = 1.5
_FAR_OFF: Final = 4
# Of a steady input, the nearest message is at most half a period away, and its jitter, unless it was lost.
_NOT_NEAREST: Final = 0.6


class Received(NamedTuple):
    """One input's messages as they arrived: stamps, times of receipt, and their places among those of all inputs."""

    stamps: Column
    received: Column
    places: Column

    @property
    def are_stamped(self) -> npt.NDArray[np.bool_]:
        """Which messages have a stamp."""
        return _are_stamped(self.stamps[:])

    def stamped(self) -> Iterator[tuple[Nanoseconds, Nanoseconds, Nanoseconds]]:
        """Yield stamps, times of receipt and places of those that have a stamp, many at a time."""
        for stamps, received, places in zip(*map(blocks, self), strict=True):
            is_set = _are_stamped(stamps)
            yield (stamps, received, places) if is_set.all() else (stamps[is_set], received[is_set], places[is_set])


def _are_stamped(stamps: Nanoseconds) -> npt.NDArray[np.bool_]:
    stamped: npt.NDArray[np.bool_] = (stamps != 0) & (stamps != UNREADABLE)
    return stamped


class InOrder(NamedTuple):
    """An input's distinct stamps in order, offset added, the place of each message, and all places in order."""

    stamps: Column
    places: Column
    arrivals: Column


class Sides(NamedTuple):
    """For each stamp of one input: how far before and after it the nearest of another is, and the first not older."""

    before: Nanoseconds
    after: Nanoseconds
    at: Nanoseconds


@dataclass(frozen=True, slots=True)
class PossibleSets:
    """The sets of one moment: a set for each message of the pivot whose partners belong to it.

    `stamps` are those of the pivot's messages without offset, `spans` those of the sets, `queues` how many messages the
    fullest queue must hold until the set is complete. `is_exact` says that the stamps of a set are meant to be equal.
    Where `is_alone`, one input is required, and each of its messages is a set with a span of 0. Where `is_at_ticks`, a
    clock triggers: there is a set for each tick at which every input has a message, and `stamps` are the ticks.
    """

    among: tuple[int, ...]
    pivot: int
    stamps: Nanoseconds
    spans: Nanoseconds
    queues: Nanoseconds
    is_exact: bool = False
    is_alone: bool = False
    is_at_ticks: bool = False

    def __len__(self) -> int:
        return len(self.spans)

    @property
    def widest(self) -> int:
        """The span of the widest, 0 where there is none."""
        return int(self.spans.max(initial=0))


def as_arrays(messages: Sequence[Message], n_inputs: int) -> tuple[Received, ...]:
    """Return messages, in the order of receipt and with the time of receipt as payload, as arrays for each input."""
    columns = np.array([(each.stamp, each.payload, each.input) for each in messages], dtype=np.int64).reshape(-1, 3)
    places = [np.nonzero(columns[:, 2] == index)[0] for index in range(n_inputs)]
    return tuple(Received(columns[at, 0], columns[at, 1], at) for at in places)


def in_order(messages: Received, offset: int) -> InOrder:
    """Sort an input's messages by stamp. Of messages with one stamp the last counts, as it does in the engine."""
    least = [int(stamps.min()) if len(stamps) else _NEVER for stamps, _, _ in messages.stamped()]
    # Stamps below the least that is still to come are in order once they are sorted.
    to_come = [*accumulate(reversed(least), min, initial=_NEVER)][-2::-1]
    ordered, waiting, lowest = Rows(2), list[Nanoseconds](), _NEVER
    for (stamps, _, places), own, bound in zip(messages.stamped(), least, to_come, strict=True):
        waiting.append(np.stack([stamps, places], axis=1))
        lowest = min(lowest, own)
        if lowest >= bound:
            continue
        held = np.concatenate(waiting)
        held = held[np.argsort(held[:, 0], kind="stable")]
        count = len(held) if bound == _NEVER else int(np.searchsorted(held[:, 0], bound))
        some, waiting = held[:count], [held[count:]]
        lowest = int(held[count, 0]) if count < len(held) else _NEVER
        some = some[np.append(some[1:, 0] != some[:-1, 0], [True])]
        ordered.append(np.stack([shifted(some[:, 0], offset), some[:, 1]], axis=1))
    return InOrder(ordered.column(0), ordered.column(1), messages.places)


def shifted(stamps: Nanoseconds, offset: int) -> Nanoseconds:
    """Add an offset to stamps, and keep them so far from the ends of 64 bits that they can be subtracted."""
    near = np.clip(stamps, -_LATEST, _LATEST)
    moved: Nanoseconds = np.clip(near + max(-_LATEST, min(_LATEST, offset)), -_LATEST, _LATEST)
    return moved


def extents(stamps: Nanoseconds, offsets: Sequence[int]) -> tuple[Nanoseconds, Nanoseconds]:
    """Return the earliest and the latest stamp of sets, offsets added: a row a set, UNREADABLE where it lacks an input.

    Of a set without any, the earliest is after the latest.
    """
    begins, ends = np.full(len(stamps), _LATEST, dtype=np.int64), np.full(len(stamps), -_LATEST, dtype=np.int64)
    for index, offset in enumerate(offsets):
        of_input = shifted(stamps[:, index], offset)
        there = stamps[:, index] != UNREADABLE
        np.minimum(begins, of_input, out=begins, where=there)
        np.maximum(ends, of_input, out=ends, where=there)
    return begins, ends


def sides(stamps: Nanoseconds, others: Nanoseconds) -> Sides:
    """Find the nearest of other stamps, in order, on both sides of each stamp."""
    at = np.searchsorted(others, stamps, side="left")
    if not len(others):
        far = np.full(len(stamps), _FAR, dtype=np.int64)
        return Sides(far, far, at)
    after = np.where(at < len(others), others[np.minimum(at, len(others) - 1)] - stamps, _FAR)
    before = np.where(at > 0, stamps - others[np.maximum(at - 1, 0)], _FAR)
    before, after = np.minimum(before, _FAR), np.minimum(after, _FAR)
    return Sides(np.where(after == 0, 0, before), after, at)


def _around(stamps: Column, others: Column) -> Iterator[tuple[Nanoseconds, slice]]:
    """Yield stamps, many at a time, and those of the others around them: one on either side, and one more behind."""
    for some in blocks(stamps):
        begin, end = bisect_left(others, some[0]), bisect_right(others, some[-1])
        yield some, slice(max(0, begin - 1), min(len(others), end + 2))


def all_sides(stamps: Column, others: Column) -> Iterator[Sides]:
    """Yield the sides of stamps of any number, many at a time; both in order."""
    for some, around in _around(stamps, others):
        found = sides(some, others[around])
        yield found._replace(at=found.at + around.start)


def signed_distances(stamps: Column, others: Column) -> Nanoseconds:
    """Return how far after each stamp the nearest of the others is, less than 0 where it is before; both in order.

    Only stamps with one of the others on either side count.
    """
    between = [np.zeros(0, dtype=np.int64)]
    for found in all_sides(stamps, others):
        signed = np.where(found.after < found.before, found.after, -found.before)
        between.append(signed[(found.at > 0) & (found.at < len(others))])
    return np.concatenate(between)


def quantile(values: Nanoseconds, share: float) -> int:
    """Return the value that `share` of all do not exceed; it occurred. Floats would lose an epoch's nanoseconds."""
    return int(np.quantile(values, share, method="inverted_cdf"))


def possible_sets(
    config: GroupConfig, inputs: Sequence[Received], among: Sequence[int], *, is_window: bool
) -> PossibleSets | None:
    """Return the sets of one moment of some inputs, by their indices; None where one of them has no stamps.

    A window cuts partners off: in one, only those messages count that have something of each input on either side.
    """
    if config.ticks is not None:
        return _sets_at_ticks(config, config.ticks, inputs, among)
    ordered = [in_order(inputs[index], config.topics[index].offset_ns) for index in among]
    if not all(len(each.stamps) for each in ordered):
        return None
    pivot = min(range(len(among)), key=lambda at: len(ordered[at].stamps))
    if config.trigger is not None:
        pivot = list(among).index(config.trigger)
    pivots, others = ordered[pivot], [each for at, each in enumerate(ordered) if at != pivot]
    is_age = config.options.distance is Distance.AGE
    successors = int(config.options.waits_for_next and config.options.max_wait is None)
    spans, queues, are_lost, partners = _sets_around(pivots, others, successors=successors, is_age=is_age)
    belong = spans < _FAR
    if is_window:
        first, last = max(each.stamps[0] for each in ordered), min(each.stamps[-1] for each in ordered)
        belong &= (pivots.stamps[:] >= first) & (pivots.stamps[:] <= last)
    is_alone = len(among) == 1
    is_exact = not is_alone and not is_age and float(np.mean(spans == 0)) >= _EQUAL
    if is_exact:
        belong &= spans == 0
    elif not is_alone and not is_age:
        belong &= ~are_lost
        periods = [period_of(each.stamps) for each in others]
        usual = quantile(spans[belong], 0.75) if belong.any() else 0
        belong &= spans <= min(_PERIODS * max(periods), _FAR_OFF * usual)
        if not config.options.repeats:
            belong &= _disjoint(spans, partners)
    unshifted = shifted(pivots.stamps[:], -config.topics[among[pivot]].offset_ns)
    return PossibleSets(
        tuple(among), among[pivot], unshifted[belong], spans[belong], queues[belong], is_exact, is_alone
    )


def _sets_around(
    pivots: InOrder, others: Sequence[InOrder], *, successors: int, is_age: bool
) -> tuple[Nanoseconds, Nanoseconds, npt.NDArray[np.bool_], list[Nanoseconds]]:
    """Return of the tightest set of each pivot its span, the fullest queue, if a partner was lost, and the partners."""
    spans, queues = np.zeros((2, len(pivots.stamps)), dtype=np.int64)
    partners = [np.zeros(len(spans), dtype=np.int64) for _ in others]
    are_lost = np.zeros(len(spans), dtype=np.bool_)
    steady = [_steady_period(each.stamps) for each in others]
    for begin in range(0, len(spans), BLOCK):
        some = slice(begin, begin + BLOCK)
        stamps = pivots.stamps[some]
        near = [_near(each, stamps) for each in others]
        found = [sides(stamps, each.stamps[:]) for each, _ in near]
        spans[some], left = _ages(len(stamps), found) if is_age else tightest_spans(len(stamps), found)
        chosen = [
            np.clip(np.where((each.before <= left) & (each.after != 0), each.at - 1, each.at), 0, len(other.stamps) - 1)
            for each, (other, _) in zip(found, near, strict=True)
        ]
        own = _near(pivots, stamps)
        at_own = np.arange(len(stamps)) + begin - own[1]
        queues[some] = _queues(
            [(own[0], at_own), *((each, at) for (each, _), at in zip(near, chosen, strict=True))],
            successors=successors,
        )
        for row, at, (_, first) in zip(partners, chosen, near, strict=True):
            row[some] = at + first
        for each, period in zip(found, steady, strict=True):
            are_lost[some] |= _is_lost(each, period)
    return spans, queues, are_lost, partners


def _near(messages: InOrder, stamps: Nanoseconds) -> tuple[InOrder, int]:
    """Return an input's messages around some stamps in order, in arrays, and the number of the first of them."""
    begin = max(0, bisect_left(messages.stamps, stamps[0]) - 1)
    some = slice(begin, bisect_right(messages.stamps, stamps[-1]) + 2)
    return InOrder(messages.stamps[some], messages.places[some], messages.arrivals), begin


def _sets_at_ticks(
    config: GroupConfig, ticks: Ticks, inputs: Sequence[Received], among: Sequence[int]
) -> PossibleSets | None:
    """Return the sets of the ticks while messages came: each leaves `max_wait` later with what came by then."""
    if not all(inputs[index].are_stamped.any() for index in among):
        return None
    received = np.sort(shifted(np.concatenate([each.received[:] for each in inputs]), 0))
    # A clock may have been set far off: ticks that rest are not counted.
    breaks = np.nonzero(np.diff(received) > REST_NS)[0]
    begins, ends = received[np.append(0, breaks + 1)].tolist(), received[np.append(breaks, -1)].tolist()
    first = max(int(inputs[index].received[:].min()) for index in among)
    numbers = chain.from_iterable(
        range(ticks.first_from(max(first, begin)), ticks.last_until(end) + 1)
        for begin, end in zip(begins, ends, strict=True)
    )
    at = np.fromiter(map(ticks.at, numbers), dtype=np.int64)
    wait, oldest = config.options.max_wait or 0, np.zeros(len(at), dtype=np.int64)
    for index in among:
        oldest = np.maximum(oldest, _ages_at(at, inputs[index], config.topics[index].offset_ns, wait))
    belong = oldest < _FAR
    queues, pivot = np.ones(len(at), dtype=np.int64), min(among, key=lambda index: len(inputs[index].stamps))
    return PossibleSets(tuple(among), pivot, at[belong], oldest[belong], queues[belong], is_at_ticks=True)


def _ages_at(ticks: Nanoseconds, messages: Received, offset: int, max_wait: int) -> Nanoseconds:
    """Return how old an input's latest message is at each tick, of those that came in time for it; _FAR without one."""
    is_set = messages.are_stamped
    stamps = shifted(messages.stamps[:][is_set], offset)
    # From the first tick after this on, a message is there.
    usable = np.maximum(stamps, shifted(messages.received[:][is_set], -max_wait))
    order = np.argsort(usable, kind="stable")
    latest, at = np.maximum.accumulate(stamps[order]), np.searchsorted(usable[order], ticks, side="right")
    ages: Nanoseconds = np.where(at > 0, np.minimum(ticks - latest[np.maximum(at - 1, 0)], _FAR), _FAR)
    return ages


def tightest_spans(count: int, found: Sequence[Sides]) -> tuple[Nanoseconds, Nanoseconds]:
    """Return the span of the tightest set around each of so many messages, and how far before it that set begins."""
    best = np.full(count, 2 * _FAR if found else 0, dtype=np.int64)
    best_left = np.zeros(count, dtype=np.int64)
    for left in [np.zeros(count, dtype=np.int64), *(each.before for each in found)] if found else ():
        reach = np.zeros(count, dtype=np.int64)
        for before, after, _ in found:
            reach = np.maximum(reach, np.where(before <= left, 0, after))
        is_less = left + reach < best
        best, best_left = np.where(is_less, left + reach, best), np.where(is_less, left, best_left)
    return best, best_left


def _ages(count: int, found: Sequence[Sides]) -> tuple[Nanoseconds, Nanoseconds]:
    """Return how much older the oldest of the latest not newer messages is than each of so many; twice, as the left."""
    oldest = np.zeros(count, dtype=np.int64)
    for each in found:
        oldest = np.maximum(oldest, each.before)
    return oldest, oldest


def _queues(chosen: Sequence[tuple[InOrder, Nanoseconds]], *, successors: int) -> Nanoseconds:
    """Return how long the fullest queue is when each set is complete, or so many messages of each input later."""
    complete = np.zeros(len(chosen[0][1]), dtype=np.int64)
    for each, at in chosen:
        complete = np.maximum(complete, each.places[:][np.minimum(at + successors, len(each.places) - 1)])
    longest, latest = np.ones(len(complete), dtype=np.int64), int(complete.max())
    for each, at in chosen:
        began = each.places[:][at]
        begin, end = bisect_left(each.arrivals, int(began.min())), bisect_right(each.arrivals, latest)
        arrivals = each.arrivals[begin:end]
        since = np.searchsorted(arrivals, began)
        longest = np.maximum(longest, np.searchsorted(arrivals, complete, side="right") - since)
    return longest


def _steady_period(stamps: Column) -> float:
    """Return the usual time between the stamps of a steady input, 0 of another."""
    period = period_of(stamps)
    return period if period and quantiles(lambda: steps(stamps), [0.75])[0] <= _PERIODS * period else 0.0


def _is_lost(found: Sides, period: float) -> npt.NDArray[np.bool_]:
    """Tell around which messages the partner of a steady input is missing: they are amid a gap, far from its ends."""
    if not period:
        return np.zeros(len(found.at), dtype=np.bool_)
    gap = found.before + found.after
    return (gap > _PERIODS * period) & (np.minimum(found.before, found.after) > _NOT_NEAREST * period)


def period_of(stamps: Column) -> float:
    """Return the usual time between stamps in order, 0 where most are equal or there is only one."""
    return median(lambda: steps(stamps)) if len(stamps) > 1 else 0.0


def _disjoint(spans: Nanoseconds, partners: Sequence[Nanoseconds]) -> npt.NDArray[np.bool_]:
    """Tell which sets share no message with a tighter one: only these are nearest to each other mutually."""
    order = np.argsort(spans, kind="stable")
    taken = [bytearray(int(each.max(initial=-1)) + 1) for each in partners]
    free = np.zeros(len(spans), dtype=np.bool_)
    for some in blocks(order):
        rows = np.stack([each[some] for each in partners], axis=1).tolist()
        for place, row in zip(some.tolist(), rows, strict=True):
            if not any(used[each] for each, used in zip(row, taken, strict=True)):
                free[place] = True
                for each, used in zip(row, taken, strict=True):
                    used[each] = True
    return free


class NearestSpans:
    """Measures the tightest set of each message of one input once, as soon as no later message can change it.

    In plain Python: of tens of messages between two polls arrays take twice as long and more, and of a thousand half.
    """

    def __init__(self, n_inputs: int, distance: Distance = Distance.SPAN) -> None:
        self._measure = _age if distance is Distance.AGE else _tightest_span
        self._stamps: list[list[int]] = [[] for _ in range(n_inputs)]
        self._measured_until: int | None = None

    def clear(self) -> None:
        """Start afresh: the stamps to come are of another time."""
        for each in self._stamps:
            each.clear()
        self._measured_until = None

    def add(self, stamps: Sequence[Sequence[int]], *, pivot: int) -> list[int]:
        """Take the stamps of each input since the last call; give the spans, of messages of `pivot`, that are certain.

        A span is certain once every input has a stamp on either side of the message.
        """
        for kept, new in zip(self._stamps, stamps, strict=True):
            if new:
                kept.extend(new)
                kept.sort()
                del kept[:-_KEPT]
        if not all(self._stamps):
            return []
        begin, end = max(each[0] for each in self._stamps), min(each[-1] for each in self._stamps)
        if self._measured_until is not None:
            begin = max(begin, self._measured_until + 1)
        pivots = self._stamps[pivot]
        pivots = pivots[bisect_left(pivots, begin) : bisect_right(pivots, end)]
        others = [each for index, each in enumerate(self._stamps) if index != pivot]
        spans = [self._measure([_side(each, stamp) for each in others]) for stamp in pivots]
        self._measured_until = end
        for each in self._stamps:
            # One before the next stretch may be the nearest to its first message.
            del each[: max(0, bisect_right(each, end) - 1)]
        return [span for span in spans if span < _FAR]


def _side(others: Sequence[int], stamp: int) -> tuple[int, int]:
    """Return how far before a stamp, and how far after it, the nearest of others is, which lie on both sides of it."""
    at = bisect_left(others, stamp)
    after = others[at] - stamp
    return (stamp - others[at - 1], after) if after else (0, 0)


def _tightest_span(sides: list[tuple[int, int]]) -> int:
    """Return the span of the tightest set around a message, of how far on both sides of it each partner may be."""
    if len(sides) == 1:
        return min(sides[0])
    sides.sort()
    lefts = [0, *(before for before, _ in sides)]
    # Those up to a place lie before the message, and all others after it.
    best, reach = lefts[-1], 0
    for left, (_, after) in zip(lefts[-2::-1], reversed(sides), strict=True):
        reach = max(reach, after)
        best = min(best, left + reach)
    return best


def _age(sides: list[tuple[int, int]]) -> int:
    """Return how much older than a message the oldest of the latest not newer partners is."""
    return max(before for before, _ in sides)
