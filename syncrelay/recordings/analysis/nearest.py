"""Which messages lie nearest to which, and so what sets there could be, whatever slop and queues are."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from syncrelay.explain import UNREADABLE
from syncrelay.recordings.analysis.streams import Stream
from syncrelay.recordings.analysis.topics import Spread, spread
from syncrelay.recordings.bag.columns import Nanoseconds
from syncrelay.recordings.bag.recording import LATEST

# So many pairs are seen at a glance: those of 4 topics.
_AT_A_GLANCE = 6
_WIDEST = 4
# Farther than what is told apart, and twice it still fits.
_FAR = 2**61


@dataclass(frozen=True, slots=True)
class Pair:
    """The signed distance of each message of `first` to the nearest of `second`: positive where that is later.

    `distance` is the same without the sign. All of `offsets` in the order of the stamps.
    """

    first: str
    second: str
    signed: Spread
    distance: Spread
    offsets: Nanoseconds


@dataclass(frozen=True, slots=True)
class Tightest:
    """For each message of the pivot, the trigger or else the slowest input, the tightest set that it could be in.

    `spans` are in nanoseconds; `queues` is how many messages the fullest queue must hold until the set is complete;
    `disjoint` tells which sets share no message with a tighter one. All in the order of the pivot's stamps.
    """

    pivot: int
    spans: Nanoseconds
    queues: Nanoseconds
    disjoint: npt.NDArray[np.bool_]

    def share_within(self, slop: int) -> float:
        """Return the share of the pivot's messages, 0 to 1, whose tightest set is no wider."""
        return float(np.mean(self.spans <= slop)) if len(self.spans) else 0.0


@dataclass(frozen=True, slots=True)
class PossibleSets:
    """The sets that a recording holds, by the tightest set of each message of the pivot.

    `spans`, sorted, are of those whose messages belong together and share none with a tighter one; `is_exact` means
    that their stamps are meant to be equal. Where `is_alone`, one input is required: each of its messages is a
    possible set, whatever slop is, with a span of 0.
    """

    tightest: Tightest
    is_exact: bool
    is_alone: bool
    spans: tuple[int, ...]

    @property
    def widest(self) -> int:
        """The span of the widest, 0 where there is none."""
        return self.spans[-1] if self.spans else 0


@dataclass(frozen=True, slots=True)
class _Sorted:
    """Distinct stamps in order, with where each was received, and how many messages had come by then."""

    stamps: Nanoseconds
    places: Nanoseconds
    arrivals: Nanoseconds


def worth_seeing(pairs: Sequence[Pair]) -> tuple[int, ...]:
    """Return the places of the pairs to show first: all where they are few, otherwise those farthest apart.

    These decide about slop. They are ranked by what 95 % of their messages keep to: a single gap would rank all pairs
    of its topic first.
    """
    if len(pairs) <= _AT_A_GLANCE:
        return tuple(range(len(pairs)))
    return tuple(sorted(range(len(pairs)), key=lambda at: -pairs[at].distance.high)[:_WIDEST])


def pair(first: Stream, second: Stream, offsets: tuple[int, int]) -> Pair | None:
    """Return how the messages of the slower stream lie to those of the other; None where one has no stamps."""
    one, other = _sorted(first, offsets[0]), _sorted(second, offsets[1])
    if not len(one.stamps) or not len(other.stamps):
        return None
    if len(one.stamps) > len(other.stamps):
        first, second, one, other = second, first, other, one
    before, after, _ = _sides(one.stamps, other.stamps)
    signed = np.where(after <= before, after, -before)
    return Pair(first.topic, second.topic, spread(signed), spread(np.abs(signed)), signed)


def tightest(
    streams: Sequence[Stream], offsets: Sequence[int], *, pivot: int | None = None, successors: int = 0
) -> Tightest | None:
    """Return the tightest set of each message of the pivot, by default the slowest; None where a stream has no stamps.

    A set can leave when all its messages are there, or, with `successors`, so many later ones of each input.
    """
    inputs = [_sorted(stream, offset) for stream, offset in zip(streams, offsets, strict=True)]
    if not all(len(each.stamps) for each in inputs):
        return None
    if pivot is None:
        pivot = min(range(len(inputs)), key=lambda index: len(inputs[index].stamps))
    pivots = inputs[pivot]
    others = [each for index, each in enumerate(inputs) if index != pivot]
    sides = [_sides(pivots.stamps, other.stamps) for other in others]
    spans, lefts = _tightest_spans(len(pivots.stamps), sides)
    chosen = [(pivots, np.arange(len(pivots.stamps)))]
    for other, (before, _, behind) in zip(others, sides, strict=True):
        # `behind` is the first not older: the partner is it, or the one before it, if that lies within.
        at = np.clip(np.where(before <= lefts, behind - 1, behind), 0, len(other.stamps) - 1)
        equal = other.stamps[np.clip(behind, 0, len(other.stamps) - 1)] == pivots.stamps
        at = np.where(equal, np.clip(behind, 0, len(other.stamps) - 1), at)
        chosen.append((other, at))
    complete = np.zeros(len(spans), dtype=np.int64)
    for each, at in chosen:
        complete = np.maximum(complete, each.places[np.minimum(at + successors, len(each.places) - 1)])
    queues = np.ones(len(spans), dtype=np.int64)
    for each, at in chosen:
        came = np.searchsorted(each.arrivals, complete, side="right")
        since = np.searchsorted(each.arrivals, each.places[at], side="left")
        queues = np.maximum(queues, came - since)
    return Tightest(pivot, spans, queues, _disjoint(spans, [at for _, at in chosen[1:]]))


def _disjoint(spans: Nanoseconds, partners: Sequence[Nanoseconds]) -> npt.NDArray[np.bool_]:
    """Tell which sets share no partner with one that is tighter: each message is in one set."""
    if not partners:
        return np.ones(len(spans), dtype=np.bool_)
    order = np.argsort(spans, kind="stable")
    rows = np.stack(partners, axis=1)[order].tolist()
    taken: list[set[int]] = [set() for _ in partners]
    free = np.zeros(len(spans), dtype=np.bool_)
    for place, row in zip(order.tolist(), rows, strict=True):
        if not any(each in used for each, used in zip(row, taken, strict=True)):
            free[place] = True
            for each, used in zip(row, taken, strict=True):
                used.add(each)
    return free


def _sorted(stream: Stream, offset: int) -> _Sorted:
    stamps, _, places = stream.numbers()
    is_set = (stamps != 0) & (stamps != UNREADABLE)
    # Of a repeated stamp the last counts, as for the engine.
    _, last = np.unique(stamps[is_set][::-1], return_index=True)
    at = len(stamps[is_set]) - 1 - last
    return _Sorted(shifted(stamps[is_set][at], offset), places[is_set][at], np.sort(places))


def shifted(stamps: Nanoseconds, offset: int) -> Nanoseconds:
    """Return stamps with an offset added, within what can be subtracted from each other, whatever the file says."""
    shift = max(-LATEST, min(LATEST, offset))
    return np.clip(stamps + shift, -LATEST, LATEST)


def _sides(pivots: Nanoseconds, stamps: Nanoseconds) -> tuple[Nanoseconds, Nanoseconds, Nanoseconds]:
    """Return how far before and after each pivot the nearest stamps lie, and the place of the first not older."""
    behind = np.searchsorted(stamps, pivots, side="left")
    after = np.where(behind < len(stamps), stamps[np.clip(behind, 0, len(stamps) - 1)] - pivots, _FAR)
    before = np.where(behind > 0, pivots - stamps[np.clip(behind - 1, 0, len(stamps) - 1)], _FAR)
    before, after = np.minimum(before, _FAR), np.minimum(after, _FAR)
    return np.where(after == 0, 0, before), after, behind


def _tightest_spans(
    pivots: int, sides: Sequence[tuple[Nanoseconds, Nanoseconds, Nanoseconds]]
) -> tuple[Nanoseconds, Nanoseconds]:
    """Return the least span of each pivot, and how far before the pivot that set begins."""
    best = np.full(pivots, 2 * _FAR, dtype=np.int64)
    best_left = np.zeros_like(best)
    for left in [np.zeros_like(best), *(before for before, _, _ in sides)]:
        reach = np.zeros_like(best)
        for before, after, _ in sides:
            reach = np.maximum(reach, np.where(before <= left, 0, after))
        span = left + reach
        is_less = span < best
        best, best_left = np.where(is_less, span, best), np.where(is_less, left, best_left)
    return best, best_left
