"""The sets that there could be of messages, whatever the slop and the queues."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Final

import numpy as np
import numpy.typing as npt

from syncrelay.config import Distance, GroupConfig
from syncrelay.explain.nearest import (
    FAR,
    Nanoseconds,
    Sides,
    ages,
    in_order,
    period_of,
    shifted,
    sides,
    tightest_spans,
)
from syncrelay.explain.received import InOrder, Received
from syncrelay.explain.rows import BLOCK, Column, Rows, blocks, extent, quantiles, steps
from syncrelay.sync.latest_at_ticks import REST_NS
from syncrelay.sync.ticks import Ticks

# Stamps are meant to be equal if this share of them is. One that is not has lost its partner.
_EQUAL: Final = 0.8
# A set that spans more periods of its slowest input, or more times the usual span, pairs messages of two moments.
_PERIODS: Final = 1.5
_FAR_OFF: Final = 4
# Of a steady input, the nearest message is at most half a period away, and its jitter, unless it was lost.
_NOT_NEAREST: Final = 0.6
# A row for each of the pivot's messages: its stamp; of the tightest set around it the span, the fullest queue, whether
# a partner was lost, and the numbers of all partners.
_STAMP, _SPAN, _QUEUE, _IS_LOST, _PARTNERS = range(5)


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
    stamps: Column
    spans: Column
    queues: Column
    widest: int
    """The span of the widest, 0 where there is none."""
    is_exact: bool = False
    is_alone: bool = False
    is_at_ticks: bool = False

    def __len__(self) -> int:
        return len(self.spans)


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
    found = _sets_around(pivots, others, successors=successors, is_age=is_age)
    first, last = pivots.stamps[0], pivots.stamps[-1]
    if is_window:
        first, last = max(each.stamps[0] for each in ordered), min(each.stamps[-1] for each in ordered)
    equal = sum(int(np.count_nonzero(rows[:, _SPAN] == 0)) for rows in found.blocks())
    is_alone = len(among) == 1
    is_exact = not is_alone and not is_age and equal / len(found) >= _EQUAL
    are_compared = not is_alone and not is_age and not is_exact
    limit: float = 0 if is_exact else FAR - 1

    def belong(rows: Nanoseconds) -> npt.NDArray[np.bool_]:
        those = (rows[:, _SPAN] <= limit) & (rows[:, _STAMP] >= first) & (rows[:, _STAMP] <= last)
        return those & (rows[:, _IS_LOST] == 0) if are_compared else those

    def spans() -> Iterator[Nanoseconds]:
        return (rows[belong(rows), _SPAN] for rows in found.blocks())

    if are_compared:
        usual = quantiles(spans, [0.75])[0] if extent(spans)[0] else 0
        limit = min(limit, _PERIODS * max(period_of(each.stamps) for each in others), _FAR_OFF * usual)
    kept, widest, offset = Rows(3), 0, config.topics[among[pivot]].offset_ns
    for rows in _mutual(found) if are_compared and not config.options.repeats else found.blocks():
        some = rows[belong(rows), : _QUEUE + 1]
        widest = max(widest, int(some[:, _SPAN].max(initial=0)))
        some[:, _STAMP] = shifted(some[:, _STAMP], -offset)
        kept.append(some)
    stamps, of_spans, queues = map(kept.column, range(kept.width))
    return PossibleSets(tuple(among), among[pivot], stamps, of_spans, queues, widest, is_exact, is_alone)


def _sets_around(pivots: InOrder, others: Sequence[InOrder], *, successors: int, is_age: bool) -> Rows:
    """Return the rows of all pivots."""
    rows = Rows(_PARTNERS + len(others))
    steady = [_steady_period(each.stamps) for each in others]
    for begin in range(0, len(pivots.stamps), BLOCK):
        stamps = pivots.stamps[begin : begin + BLOCK]
        near = [_near(each, stamps) for each in others]
        found = [sides(stamps, each.stamps[:]) for each, _ in near]
        spans, left = ages(len(stamps), found) if is_age else tightest_spans(len(stamps), found)
        chosen = [
            np.clip(np.where((each.before <= left) & (each.after != 0), each.at - 1, each.at), 0, len(other.stamps) - 1)
            for each, (other, _) in zip(found, near, strict=True)
        ]
        own = _near(pivots, stamps)
        at_own = np.arange(len(stamps)) + begin - own[1]
        queues = _queues(
            [(own[0], at_own), *((each, at) for (each, _), at in zip(near, chosen, strict=True))],
            successors=successors,
        )
        partners = [at + first for at, (_, first) in zip(chosen, near, strict=True)]
        are_lost = np.zeros(len(stamps), dtype=np.bool_)
        for each, period in zip(found, steady, strict=True):
            are_lost |= _is_lost(each, period)
        rows.append(np.stack([stamps, spans, queues, are_lost, *partners], axis=1))
    return rows


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
    belong = oldest < FAR
    queues, pivot = np.ones(len(at), dtype=np.int64), min(among, key=lambda index: len(inputs[index].stamps))
    widest = int(oldest[belong].max(initial=0))
    return PossibleSets(tuple(among), pivot, at[belong], oldest[belong], queues[belong], widest, is_at_ticks=True)


def _ages_at(ticks: Nanoseconds, messages: Received, offset: int, max_wait: int) -> Nanoseconds:
    """Return how old an input's latest message is at each tick, of those that came in time for it; FAR without one."""
    is_set = messages.are_stamped
    stamps = shifted(messages.stamps[:][is_set], offset)
    # From the first tick after this on, a message is there.
    usable = np.maximum(stamps, shifted(messages.received[:][is_set], -max_wait))
    order = np.argsort(usable, kind="stable")
    latest, at = np.maximum.accumulate(stamps[order]), np.searchsorted(usable[order], ticks, side="right")
    ages: Nanoseconds = np.where(at > 0, np.minimum(ticks - latest[np.maximum(at - 1, 0)], FAR), FAR)
    return ages


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


def _mutual(found: Rows) -> Iterator[Nanoseconds]:
    """Yield those sets that share no message with a tighter one: only these are nearest to each other mutually."""
    for rows in _apart(found):
        are_shared = np.zeros(len(rows), dtype=np.bool_)
        for each in rows[:, _PARTNERS:].T:
            _, which, counts = np.unique(each, return_inverse=True, return_counts=True)
            are_shared |= counts[which] > 1
        free, taken = ~are_shared, [set[int]() for _ in range(_PARTNERS, found.width)]
        order = np.flatnonzero(are_shared)
        for places in blocks(order[np.argsort(rows[order, _SPAN], kind="stable")]):
            for place, partners in zip(places.tolist(), rows[places, _PARTNERS:].tolist(), strict=True):
                if not any(each in used for each, used in zip(partners, taken, strict=True)):
                    free[place] = True
                    for each, used in zip(partners, taken, strict=True):
                        used.add(each)
        yield rows[free]


def _apart(found: Rows) -> Iterator[Nanoseconds]:
    """Yield rows in order, many at a time; none shares a partner with one that is yielded at another time."""
    held, most = list[Nanoseconds](), np.full(found.width - _PARTNERS, -1)
    for rows in found.blocks():
        partners = rows[:, _PARTNERS:]
        before = np.maximum.accumulate(np.maximum(partners, most))
        # A partner is one of the two around a stamp, so it is at most one before that of an earlier stamp.
        behind = np.concatenate([partners[1:], partners[-1:] - 1])
        to_come = np.minimum.accumulate(behind[::-1])[::-1]
        ends = np.flatnonzero((before < to_come).all(axis=1))
        end, most = int(ends[-1]) + 1 if len(ends) else 0, before[-1]
        if end:
            yield np.concatenate([*held, rows[:end]])
            held = []
        held.append(rows[end:])
    yield np.concatenate(held)
