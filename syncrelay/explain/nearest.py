"""The tightest set that each message of the slowest input could have had, whatever the slop and the queues."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

# More than comes between two looks; what an input piles up while another is silent is cut to this.
_KEPT = 5_000


class NearestSpans:
    """Measures spans in nanoseconds over the stamps that come in, as soon as they are certain.

    The pivot is the input with the fewest messages in the stretch that is measured. With a `trigger`, an input's
    index, it is that one, and what is measured is the greatest age of the latest not newer message of the others.
    """

    def __init__(self, n_inputs: int, *, trigger: int | None = None) -> None:
        self._stamps: list[list[int]] = [[] for _ in range(n_inputs)]
        self._trigger = trigger
        self._measured_until: int | None = None

    def clear(self) -> None:
        """Start afresh: the stamps to come are of another time."""
        self._stamps = [[] for _ in self._stamps]
        self._measured_until = None

    def add(self, stamps: Sequence[Sequence[int]]) -> list[int]:
        """Take the stamps of each input that came since the last call; give the spans that are certain now."""
        for kept, new in zip(self._stamps, stamps, strict=True):
            kept.extend(new)
            kept.sort()
            del kept[: max(0, len(kept) - _KEPT)]
        if not all(self._stamps):
            return []
        begin, end = self._stretch()
        counts = [bisect_right(kept, end) - bisect_left(kept, begin) for kept in self._stamps]
        pivot = counts.index(min(counts)) if self._trigger is None else self._trigger
        pivots = self._stamps[pivot]
        places = range(bisect_left(pivots, begin), bisect_right(pivots, end))
        spans = [span for place in places if (span := self._span_at(pivots[place], pivot)) is not None]
        self._measured_until = end
        for kept in self._stamps:
            # One before the stretch to come may be the nearest to its first message.
            del kept[: max(0, bisect_right(kept, end) - 1)]
        return spans

    def _stretch(self) -> tuple[int, int]:
        """Give the first and the last stamp that can be measured now: every input has something on either side."""
        first = max(kept[0] for kept in self._stamps)
        begin = first if self._measured_until is None else max(first, self._measured_until + 1)
        return begin, min(kept[-1] for kept in self._stamps)

    def _span_at(self, stamp: int, pivot: int) -> int | None:
        """Give the span of the tightest set that holds this stamp of the pivot, None where there is none."""
        sides = []
        for index, kept in enumerate(self._stamps):
            if index != pivot:
                after = bisect_left(kept, stamp)
                is_equal = kept[after] == stamp
                before = 0 if is_equal else stamp - kept[after - 1] if after else None
                sides.append((before, kept[after] - stamp))
        if self._trigger is not None:
            ages = [before for before, _ in sides if before is not None]
            return max(ages) if len(ages) == len(sides) else None
        return min(_span_from(left, sides) for left in {0, *(before for before, _ in sides if before is not None)})


def _span_from(left: int, sides: Sequence[tuple[int | None, int]]) -> int:
    """Give the span of the set that begins `left` before its pivot: what does not lie within comes after it."""
    return left + max(0 if before is not None and before <= left else after for before, after in sides)
