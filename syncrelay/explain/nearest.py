"""Which messages are nearest to which, on arrays, whatever the slop and the queues."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from itertools import accumulate
from operator import itemgetter
from typing import Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from syncrelay.clock import UNREADABLE
from syncrelay.config import Distance
from syncrelay.explain.received import InOrder, Received
from syncrelay.explain.rows import Column, Rows, blocks, median, quantiles, steps

Nanoseconds: TypeAlias = npt.NDArray[np.int64]

# More than arrives between two polls at 1 kHz. Of an input whose partner is silent, no more are kept.
_KEPT: Final = 5_000
# So many partners are looked for in arrays, fewer in plain Python.
_MANY: Final = 128
FAR: Final = 2**61
"""Stands for "no message on this side". Twice this still fits into 64 bits."""

_LATEST: Final = 2**62 - 1
# Later than any stamp.
_NEVER: Final = 2**63
LONGEST: Final = _LATEST
"""No offset or wait longer than this, 146 years, is tried: as a duration of the file it might be out of range."""


class Sides(NamedTuple):
    """For each stamp of one input: how far before and after it the nearest of another is, and the first not older."""

    before: Nanoseconds
    after: Nanoseconds
    at: Nanoseconds


def in_order(messages: Received, offset: int) -> InOrder:
    """Sort an input's messages by stamp. Of messages with one stamp the last counts, as it does in the engine."""
    if offset not in messages.ordered:
        messages.ordered[offset] = _sorted(messages, offset)
    return messages.ordered[offset]


def _sorted(messages: Received, offset: int) -> InOrder:
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
    return _clipped(_clipped(stamps) + max(-_LATEST, min(_LATEST, offset)))


def _clipped(stamps: Nanoseconds) -> Nanoseconds:
    # np.clip takes five times as long for a few hundred.
    clipped: Nanoseconds = np.minimum(np.maximum(stamps, -_LATEST), _LATEST)
    return clipped


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
        far = np.full(len(stamps), FAR, dtype=np.int64)
        return Sides(far, far, at)
    after = np.where(at < len(others), others[np.minimum(at, len(others) - 1)] - stamps, FAR)
    before = np.where(at > 0, stamps - others[np.maximum(at - 1, 0)], FAR)
    before, after = np.minimum(before, FAR), np.minimum(after, FAR)
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


def quantile(values: Column, share: float) -> int:
    """Return the value that `share` of all do not exceed; it occurred. Floats would lose an epoch's nanoseconds."""
    return quantiles(lambda: blocks(values), [share])[0]


def tightest_spans(count: int, found: Sequence[Sides]) -> tuple[Nanoseconds, Nanoseconds]:
    """Return the span of the tightest set around each of so many messages, and how far before it that set begins."""
    best = np.full(count, 2 * FAR if found else 0, dtype=np.int64)
    best_left = np.zeros(count, dtype=np.int64)
    for left in [np.zeros(count, dtype=np.int64), *(each.before for each in found)] if found else ():
        reach = np.zeros(count, dtype=np.int64)
        for before, after, _ in found:
            reach = np.maximum(reach, np.where(before <= left, 0, after))
        is_less = left + reach < best
        best, best_left = np.where(is_less, left + reach, best), np.where(is_less, left, best_left)
    return best, best_left


def ages(count: int, found: Sequence[Sides]) -> tuple[Nanoseconds, Nanoseconds]:
    """Return how much older the oldest of the latest not newer messages is than each of so many; twice, as the left."""
    oldest = np.zeros(count, dtype=np.int64)
    for each in found:
        oldest = np.maximum(oldest, each.before)
    return oldest, oldest


def period_of(stamps: Column) -> float:
    """Return the usual time between stamps in order, 0 where most are equal or there is only one."""
    return median(lambda: steps(stamps)) if len(stamps) > 1 else 0.0


class NearestSpans:
    """Measures the tightest set of each message of one input once, as soon as no later message can change it.

    In plain Python where few came between two polls: of tens of messages, arrays take twice as long and more. Of
    hundreds they take a fifth to a half.
    """

    def __init__(self, n_inputs: int, distance: Distance = Distance.SPAN) -> None:
        is_age = distance is Distance.AGE
        self._measure = _age if is_age else _tightest_span
        self._measure_all = ages if is_age else tightest_spans
        self._measure_one: Callable[[tuple[int, int]], int] = itemgetter(0) if is_age else min
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
        # Partners with the same stamps, as of one trigger, are in each set: there is nothing to measure.
        others = [each for each in self._stamps if each[bisect_left(each, begin) : bisect_right(each, end)] != pivots]
        if not others:
            spans = [0] * len(pivots)
        elif len(pivots) * len(others) >= _MANY and all(each[0] > -FAR and each[-1] < FAR for each in others):
            found = [sides(np.array(pivots), np.array(each)) for each in others]
            spans = self._measure_all(len(pivots), found)[0].tolist()
        elif len(others) == 1:
            # As of most groups, and without the list of its sides.
            spans = [self._measure_one(_side(others[0], stamp)) for stamp in pivots]
        else:
            spans = [self._measure([_side(each, stamp) for each in others]) for stamp in pivots]
        self._measured_until = end
        for each in self._stamps:
            # One before the next stretch may be the nearest to its first message.
            del each[: max(0, bisect_right(each, end) - 1)]
        return [span for span in spans if span < FAR]


def _side(others: Sequence[int], stamp: int) -> tuple[int, int]:
    """Return how far before a stamp, and how far after it, the nearest of others is, which lie on both sides of it."""
    at = bisect_left(others, stamp)
    after = others[at] - stamp
    return (stamp - others[at - 1], after) if after else (0, 0)


def _tightest_span(sides: list[tuple[int, int]]) -> int:
    """Return the span of the tightest set around a message, of how far on both sides of it each partner may be."""
    sides.sort()
    lefts = [0, *(before for before, _ in sides)]
    # Those up to a place lie before the message, and all others after it.
    best, reach = lefts[-1], 0
    for left, (_, after) in zip(lefts[-2::-1], reversed(sides), strict=True):
        reach = max(reach, after)
        if reach >= best:
            # It only grows.
            break
        best = min(best, left + reach)
    return best


def _age(sides: list[tuple[int, int]]) -> int:
    """Return how much older than a message the oldest of the latest not newer partners is."""
    return max(before for before, _ in sides)
