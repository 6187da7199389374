"""What a group of a file would make of the messages of a recording, one by one: the engine itself is run on them.

It is run once. What the running relay would have seen of it, once a second, is noted on the way.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from syncrelay.config import GroupConfig
from syncrelay.explain import UNREADABLE, EngineDriver
from syncrelay.explain.feeding import REASONS, Left, feed
from syncrelay.explain.nearest import extents
from syncrelay.explain.received import Messages, stretches
from syncrelay.explain.rows import BLOCK, Column, Numbers, Rows
from syncrelay.recordings.analysis.streams import Stream, transforms_beside
from syncrelay.sync import DropReason, InputCounts, Lapse, SyncGroup

_SECOND: Final = 1_000_000_000
# Findings speak of the last seconds: fewer than these.
_CLOSELY: Final = 16
# What a look tells of an input, beside its drops by reason. None stands for a queue that was long enough.
_FED, _MATCHED, _BUFFERED, _NEEDED, _DROPPED = range(5)
_NONE: Final = -1

SentSet: TypeAlias = tuple[tuple[int | None, ...], int]
"""The stamps of a set, None where one is missing, and its latency."""


@dataclass(frozen=True, slots=True)
class SetOut:
    """A set: its stamps in input order, when it left, its span, and how long it waited for that when complete."""

    stamps: tuple[int | None, ...]
    left: int
    span: int
    latency: int


@dataclass(frozen=True, slots=True)
class DropOut:
    """A message that left unmatched: its input, its stamp, when it was received, and why."""

    input: int
    stamp: int
    received: int
    reason: DropReason


class Sets:
    """All sets, in the order in which they left.

    A row is the stamps in input order, UNREADABLE where one is missing, when the set left, its latency and its span.
    """

    def __init__(self, n_inputs: int) -> None:
        self.n_inputs: Final = n_inputs
        self.rows: Final = Rows(n_inputs + 3)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def left(self) -> Column:
        """When they left."""
        return self.rows.column(self.n_inputs)

    @property
    def latencies(self) -> Column:
        """How long they waited when they were complete."""
        return self.rows.column(self.n_inputs + 1)

    @property
    def spans(self) -> Column:
        """How far apart their stamps are, offsets included."""
        return self.rows.column(self.n_inputs + 2)

    def __iter__(self) -> Iterator[SetOut]:
        for *stamps, left, latency, span in self.rows.lists():
            yield SetOut(_or_none(stamps), left, span, latency)

    def sent(self, first: int, after: int) -> list[SentSet]:
        """Return some sets by their numbers."""
        return [(_or_none(stamps), latency) for *stamps, _, latency, _ in self.rows[first:after].tolist()]


def _or_none(stamps: Sequence[int]) -> tuple[int | None, ...]:
    return tuple([None if each == UNREADABLE else each for each in stamps])


class Drops:
    """All messages that left unmatched, in their order.

    A row is the input, the stamp, the time of receipt and the number of the reason.
    """

    def __init__(self) -> None:
        self.rows: Final = Rows(4)

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[DropOut]:
        for index, stamp, received, number in self.rows.lists():
            yield DropOut(index, stamp, received, REASONS[number])

    def numbered(self) -> Iterator[tuple[int, Numbers]]:
        """Yield the number of the first of some thousand drops, and their rows."""
        return zip(range(0, len(self.rows), BLOCK), self.rows.blocks(), strict=True)


class Look(NamedTuple):
    """What there is to see of a group `at` a time: it stands for so many `seconds`, and that many sets had left."""

    at: int
    seconds: int
    sets: int
    counts: tuple[InputCounts, ...]
    lapses: tuple[Lapse, ...]


class Looks:
    """What was to be seen of a group as its messages came, once a second."""

    def __init__(self, n_inputs: int) -> None:
        self.n_inputs: Final = n_inputs
        self._rows = Rows(3 + n_inputs * (_DROPPED + len(REASONS)))
        self._lapses: dict[int, tuple[Lapse, ...]] = {}
        self.known = 0
        """How many sets had left by the last message."""
        self.ahead = Sets(n_inputs)
        """Those that left later, as the looks after the last message saw it."""

    def note(self, engine: SyncGroup, at: int, seconds: int) -> None:
        """Look at an engine."""
        row = [at, seconds, engine.sets]
        for each in engine.counts():
            needed = _NONE if each.needed_queue is None else each.needed_queue
            row += (each.fed, each.matched, each.buffered, needed, *(each.dropped.get(reason, 0) for reason in REASONS))
        lapses = tuple(engine.lapses)
        if lapses != next(reversed(self._lapses.values()), ()):
            self._lapses[len(self._rows)] = lapses
        self._rows.append(np.array([row], dtype=np.int64))

    def in_order(self, last: Sequence[InputCounts]) -> Iterator[Look]:
        """Yield all looks; `last` has an input's drops in the order in which their reasons first occurred."""
        orders = [dict.fromkeys((*map(REASONS.index, each.dropped), *range(len(REASONS)))) for each in last]
        lapses: tuple[Lapse, ...] = ()
        for place, (at, seconds, sets, *of_inputs) in enumerate(self._rows.lists()):
            lapses = self._lapses.get(place, lapses)
            width = len(of_inputs) // self.n_inputs
            counts = (
                _counts(of_inputs[index * width : (index + 1) * width], order) for index, order in enumerate(orders)
            )
            yield Look(at, seconds, sets, tuple(counts), lapses)


def _counts(row: Sequence[int], order: Iterable[int]) -> InputCounts:
    dropped = {REASONS[number]: count for number in order if (count := row[_DROPPED + number])}
    needed = None if row[_NEEDED] == _NONE else row[_NEEDED]
    return InputCounts(row[_FED], row[_MATCHED], dropped, row[_BUFFERED], needed)


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What a group made of the streams of its inputs."""

    counts: tuple[InputCounts, ...]
    sets: Sets
    drops: Drops
    looks: Looks
    lapses: tuple[Lapse, ...] = ()

    def seen(self) -> Iterator[tuple[Look, list[SentSet]]]:
        """Yield what was to be seen, once a second, and the sets that had left since the time before."""
        before, known = 0, self.looks.known
        for look in self.looks.in_order(self.counts):
            sets = self.sets.sent(before, min(look.sets, known))
            sets += self.looks.ahead.sent(max(0, before - known), max(0, look.sets - known))
            before = look.sets
            yield look, sets


class _Outcomes:
    """Takes what leaves an engine."""

    def __init__(self, group: GroupConfig) -> None:
        self.sets: Final = Sets(len(group.topics))
        self.drops: Final = Drops()
        self.left: Final = Left(len(group.topics))
        self._offsets = [topic.offset_ns for topic in group.topics]

    def feed(self, driver: EngineDriver, messages: Messages) -> int:
        """Feed messages to an engine; return when the last was received."""
        now = feed(driver, messages, self.left)
        if len(self.left.sets) > BLOCK or len(self.left.drops) > BLOCK:
            self.flush()
        return now

    def flush(self) -> None:
        """Have all in the rows."""
        sets, drops = self.left.taken()
        stamps = sets[:, : len(self._offsets)]
        begins, ends = extents(stamps, self._offsets)
        self.sets.rows.append(np.column_stack([stamps, sets[:, len(self._offsets) + 1 :], ends - begins]))
        self.drops.rows.append(drops)


def evaluate(group: GroupConfig, streams: Sequence[Stream], *, until: int | None = None) -> Evaluation:
    """Return what a group makes of the streams of its inputs.

    It is looked at to the last message, or `until` later than that in nanoseconds of receipt. However long nothing is
    received, that takes no more than some tens of looks.
    """
    outcomes, looks = _Outcomes(group), Looks(len(group.topics))
    driver = EngineDriver(group, outcomes.left.add, transforms_beside(streams))
    now, due = 0, None
    for some in stretches([stream.as_received() for stream in streams]):
        due = int(some.received[0]) + _SECOND if due is None else due
        newest, fed = np.maximum.accumulate(some.received), 0
        while (place := int(np.searchsorted(newest, due))) < len(newest):
            outcomes.feed(driver, some.part(fed, place))
            fed, due = place, _look_until(int(some.received[place]), due, driver, looks)
        now = outcomes.feed(driver, some.part(fed, len(newest)))
    if due is not None:
        outcomes_ahead = _Outcomes(group)
        ahead = driver.ahead(outcomes_ahead.left.add)
        if until is not None and until >= due:
            due = _look_until(until, due, ahead, looks)
        ahead.expire(due)
        looks.note(ahead.engine, due, 1)
        outcomes_ahead.flush()
        looks.known, looks.ahead = driver.engine.sets, outcomes_ahead.sets
    driver.finish(now)
    outcomes.flush()
    return Evaluation(driver.engine.counts(), outcomes.sets, outcomes.drops, looks, tuple(driver.engine.lapses))


def _look_until(now: int, due: int, driver: EngineDriver, looks: Looks) -> int:
    """Look at the seconds that end from `due` up to `now`; return when the next one does."""
    before = 0
    for second in looked_at((now - due) // _SECOND + 1):
        at = due + (second - 1) * _SECOND
        driver.expire(at)
        looks.note(driver.engine, at, second - before)
        before = second
    return due + before * _SECOND


def looked_at(seconds: int) -> list[int]:
    """Return which of so many seconds without a message are looked at: first and last ones, between ever fewer.

    When a pause begins and ends, findings come and go; one of years is as one of minutes.
    """
    first = range(1, min(seconds, _CLOSELY) + 1)
    between = (_CLOSELY << times for times in range(1, (max(0, seconds) // _CLOSELY).bit_length()))
    last = range(max(seconds - _CLOSELY, _CLOSELY) + 1, seconds + 1)
    return sorted({*first, *between, *last})
