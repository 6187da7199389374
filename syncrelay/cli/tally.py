"""Figures of a running relay, from its snapshots: rates over the last seconds, spans and totals over all of them."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from statistics import median, quantiles

from syncrelay.explain import RecentSet
from syncrelay.ros.snapshot import GroupSnapshot, RelaySnapshot

# Long enough that one message of a 10 Hz input is 2.5 % of the rate, short enough to follow a change.
_WINDOW_S = 4.0


@dataclass(frozen=True, slots=True)
class GroupPlan:
    """What the file says of a group, for people to read: times in nanoseconds, offsets in input order."""

    policy: str
    slop: int
    offsets: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Spans:
    """Spans of sets in nanoseconds. `unshifted` is the median that the same sets have without the file's offsets."""

    median: int
    p95: int
    unshifted: int


@dataclass(frozen=True, slots=True)
class GroupFigures:
    """One group at one moment. Rates are of the last seconds; `best_hz` is that of the slowest input.

    `possible` is how many sets could have come so far: one for each message of the slowest input, from when
    every input had given some. In `state`, recent outcomes have the stamps they were matched by, offsets added.
    """

    plan: GroupPlan
    state: GroupSnapshot
    sets_hz: float
    best_hz: float
    input_hz: tuple[float, ...]
    spans: Spans | None
    possible: int


class Tally:
    """Gathers snapshots of one relay, oldest first, whose recent outcomes have the stamps that messages carry.

    Spans are complete as long as no more than a snapshot's recent outcomes happen between two of them.
    """

    def __init__(self, plans: Sequence[GroupPlan]) -> None:
        self._plans = tuple(plans)
        self._window: deque[tuple[float, RelaySnapshot]] = deque()
        self._sets_seen = [0] * len(plans)
        self._before_all_gave: list[tuple[float, GroupSnapshot] | None] = [None] * len(plans)
        self._spans: list[list[int]] = [[] for _ in plans]
        self._unshifted: list[list[int]] = [[] for _ in plans]

    def add(self, elapsed_s: float, snapshot: RelaySnapshot) -> None:
        """Take in what the relay shows `elapsed_s` seconds after its start."""
        self._window.append((elapsed_s, snapshot))
        # The first stays until its successor is as old as the window, so that the two ends span it.
        while len(self._window) > 1 and self._window[1][0] <= elapsed_s - _WINDOW_S:
            self._window.popleft()
        for index, group in enumerate(snapshot.groups):
            self._add_spans(index, group)
            if not all(each.counts.fed for each in group.inputs):
                self._before_all_gave[index] = elapsed_s, group

    def _add_spans(self, index: int, group: GroupSnapshot) -> None:
        new = group.sets - self._sets_seen[index]
        self._sets_seen[index] = group.sets
        newest_first = (entry for entry in reversed(group.recent) if isinstance(entry, RecentSet))
        for a_set in islice(newest_first, new):
            self._spans[index].append(_span(a_set.shifted(self._plans[index].offsets).stamps))
            self._unshifted[index].append(_span(a_set.stamps))

    def figures(self) -> tuple[GroupFigures, ...]:
        """Return every group's figures as of the last snapshot."""
        return tuple(self._figures(index) for index in range(len(self._plans)))

    def _figures(self, index: int) -> GroupFigures:
        now_s, snapshot = self._window[-1]
        after = snapshot.groups[index]
        began_s, before = self._begin(index)
        passed_s = now_s - began_s
        input_hz = tuple(_rate(count, passed_s) for count in _fed_since(before, after))
        start = self._before_all_gave[index]
        return GroupFigures(
            plan=self._plans[index],
            state=_as_matched(after, self._plans[index].offsets),
            sets_hz=_rate(after.sets - before.sets, passed_s),
            best_hz=min(input_hz),
            input_hz=input_hz,
            spans=_spans(self._spans[index], self._unshifted[index]),
            possible=min(_fed_since(start and start[1], after)),
        )

    def _begin(self, index: int) -> tuple[float, GroupSnapshot]:
        """Return where rates are measured from: the window's begin, or when every input had given something."""
        (first_s, first), (now_s, _) = self._window[0], self._window[-1]
        start = self._before_all_gave[index]
        if start is not None and first_s < start[0] < now_s:
            return start
        return first_s, first.groups[index]


def _fed_since(before: GroupSnapshot | None, after: GroupSnapshot) -> list[int]:
    fed = [each.counts.fed for each in after.inputs]
    if before is None:
        return fed
    return [count - old.counts.fed for count, old in zip(fed, before.inputs, strict=True)]


def _span(stamps: Sequence[int | None]) -> int:
    present = [stamp for stamp in stamps if stamp is not None]
    return max(present) - min(present)


def _as_matched(group: GroupSnapshot, offsets: Sequence[int]) -> GroupSnapshot:
    return replace(group, recent=tuple(outcome.shifted(offsets) for outcome in group.recent))


def _rate(count: int, seconds: float) -> float:
    return count / seconds if seconds > 0 else 0.0


def _spans(spans: Sequence[int], unshifted: Sequence[int]) -> Spans | None:
    if not spans:
        return None
    p95 = quantiles(spans, n=20, method="inclusive")[-1] if len(spans) > 1 else spans[0]
    return Spans(median=round(median(spans)), p95=round(p95), unshifted=round(median(unshifted)))
