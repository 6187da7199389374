"""The tightest set that each message of one input could have had, whatever the slop and the queues."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Mapping, Sequence
from typing import Final, TypeAlias

from syncrelay.config import Distance
from syncrelay.explain.distribution import Distribution

# More than comes between two looks, at 1 kHz; what an input piles up while another is silent is cut to this.
_KEPT = 5_000

Sides: TypeAlias = Sequence[tuple[int | None, int]]
"""For each other input: how far before the message its nearest one is, None where there is none, and how far after."""


def tightest_span(sides: Sides) -> int | None:
    """Return the span of the tightest set around a message."""
    if len(sides) == 1:
        before, after = sides[0]
        return after if before is None else min(before, after)
    return min(_span_from(left, sides) for left in {0, *(before for before, _ in sides if before is not None)})


def _span_from(left: int, sides: Sides) -> int:
    """Give the span of the set that begins `left` before its message: what does not lie within comes after it."""
    return left + max(0 if before is not None and before <= left else after for before, after in sides)


def greatest_age(sides: Sides) -> int | None:
    """Return how much older than a message the latest not newer one of the others is at most, None if one has none."""
    ages = [before for before, _ in sides if before is not None]
    return max(ages) if len(ages) == len(sides) else None


_MEASURES: Final[Mapping[Distance, Callable[[Sides], int | None]]] = {
    Distance.SPAN: tightest_span,
    Distance.AGE: greatest_age,
}


def signed_distances(stamps: Sequence[int], others: Sequence[int]) -> Distribution:
    """Return how far after each stamp the nearest of the others is, less than 0 where it is before; in order both.

    Only of stamps that have one on either side.
    """
    places = [bisect_left(others, stamp) for stamp in stamps]
    return Distribution(
        [
            min(others[place] - stamp, others[place - 1] - stamp, key=abs)
            for stamp, place in zip(stamps, places, strict=True)
            if 0 < place < len(others)
        ]
    )


class NearestSpans:
    """Measures, in nanoseconds, over the stamps that come in, as soon as it is certain, each message once."""

    def __init__(self, n_inputs: int, distance: Distance = Distance.SPAN) -> None:
        self._stamps: list[list[int]] = [[] for _ in range(n_inputs)]
        self._measure = _MEASURES[distance]
        self._measured_until: int | None = None

    def clear(self) -> None:
        """Start afresh: the stamps to come are of another time."""
        self._stamps = [[] for _ in self._stamps]
        self._measured_until = None

    def add(self, stamps: Sequence[Sequence[int]], *, pivot: int) -> list[int]:
        """Take the stamps of each input that came since the last call; give the spans that are certain now.

        They are those of the messages of the `pivot`, an input's index.
        """
        for kept, new in zip(self._stamps, stamps, strict=True):
            kept.extend(new)
            kept.sort()
            del kept[: max(0, len(kept) - _KEPT)]
        if not all(self._stamps):
            return []
        begin, end = self._stretch()
        pivots = self._stamps[pivot]
        others = [kept for index, kept in enumerate(self._stamps) if index != pivot]
        measured = pivots[bisect_left(pivots, begin) : bisect_right(pivots, end)]
        measure = self._measure
        spans = [measure([_sides(kept, stamp) for kept in others]) for stamp in measured]
        self._measured_until = end
        for kept in self._stamps:
            # One before the stretch to come may be the nearest to its first message.
            del kept[: max(0, bisect_right(kept, end) - 1)]
        return [span for span in spans if span is not None]

    def _stretch(self) -> tuple[int, int]:
        """Give the first and the last stamp that can be measured now: every input has something on either side."""
        first = max(kept[0] for kept in self._stamps)
        begin = first if self._measured_until is None else max(first, self._measured_until + 1)
        return begin, min(kept[-1] for kept in self._stamps)


def _sides(kept: Sequence[int], stamp: int) -> tuple[int | None, int]:
    after = bisect_left(kept, stamp)
    distance = kept[after] - stamp
    return 0 if distance == 0 else stamp - kept[after - 1] if after else None, distance
