"""Where the messages of a group stand on a line of time, what became of each, and which are a set."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from syncrelay.explain import UNREADABLE
from syncrelay.explain.feeding import REASONS
from syncrelay.explain.rows import extent, quantiles
from syncrelay.recordings.analysis import GroupAnalysis
from syncrelay.recordings.bag.columns import Nanoseconds
from syncrelay.status.fates import CODES, MATCHED, UNNEEDED

_SECOND: Final = 1_000_000_000
_STRETCH: Final = 10 * _SECOND
# A stamp that differs by more from the time of receipt, less the usual delay, does not say when its message was made.
# It comes from another clock, or the recording began again.
_ASTRAY: Final = 2 * _SECOND
_NONE: Final = -1
# Sums of it with any time of receipt and any stamp fit 64 bits.
_LARGEST_OFFSET: Final = 2**61


@dataclass(frozen=True, slots=True)
class Lane:
    """The messages of one input: nanoseconds since the recording's begin, rising, and codes of their fates."""

    topic: str
    times: Nanoseconds
    fates: Nanoseconds


@dataclass(frozen=True, slots=True)
class Lanes:
    """A group's messages and sets.

    A row of `members` is a set: the index of its message in each lane, -1 where an input is missing. Sets are in the
    order of their earliest messages, `begins`. `astray` messages are drawn at their time of receipt, because their
    stamps are unset or seconds off the usual delay. One of every `each` stretches of 10 s is kept whole; 1 keeps all.
    """

    lanes: tuple[Lane, ...]
    members: Nanoseconds
    begins: Nanoseconds
    spans: Nanoseconds
    latencies: Nanoseconds
    astray: int
    each: int
    stretch: int = _STRETCH


class _Sets(NamedTuple):
    """Sets in the order in which they left, and how many of their messages are `astray`.

    In a column for each input, `numbers` are those of its messages among all that are in sets, -1 where one is missing,
    and `made` is when they were.
    """

    numbers: Nanoseconds
    made: Nanoseconds
    begins: Nanoseconds
    spans: Nanoseconds
    latencies: Nanoseconds
    astray: int


def lanes_of(group: GroupAnalysis, begin: int, *, most: int) -> Lanes:
    """Return the lanes of a group in a recording that begins at `begin`, with about `most` messages."""
    origin, n_inputs = begin - _usual_delay(group), len(group.streams)
    counts = [len(group.evaluation.drops), *[0] * n_inputs]
    for some in _sets(group, origin, begin):
        counts[1:] = np.maximum(counts[1:], some.numbers.max(axis=0) + 1).tolist()
    each = max(1, -(-sum(counts) // most))

    def are_kept(times: Nanoseconds) -> npt.NDArray[np.bool_]:
        kept: npt.NDArray[np.bool_] = times // _STRETCH % each == 0
        return kept

    astray, of_sets = 0, [np.zeros((0, n_inputs + 3), dtype=np.int64)]
    matched = [[np.zeros((0, 2), dtype=np.int64)] for _ in range(n_inputs)]
    for some in _sets(group, origin, begin):
        astray += some.astray
        kept_sets = are_kept(some.begins)
        rows = np.column_stack([some.numbers, some.begins, some.spans, some.latencies])
        of_sets.append(rows[kept_sets])
        # A set is whole even where it reaches out of its stretch.
        kept = (some.numbers != _NONE) & (are_kept(some.made) | kept_sets[:, None])
        for index, found in enumerate(matched):
            own = kept[:, index]
            found.append(np.stack([some.numbers[own, index], some.made[own, index]], axis=1))
    sets = np.concatenate(of_sets)
    sets = sets[np.argsort(sets[:, n_inputs], kind="stable")]

    lanes, columns = [], []
    for index, stream in enumerate(group.streams):
        numbers, first = np.unique((rows := np.concatenate(matched[index]))[:, 0], return_index=True)
        dropped, n_astray = _dropped(group, index, origin, begin, are_kept)
        astray += n_astray
        fates = np.full(len(numbers), CODES[MATCHED], dtype=np.int64)
        messages = np.concatenate([np.stack([rows[first, 1], fates], axis=1), dropped])
        order = np.argsort(messages[:, 0], kind="stable")
        lanes.append(Lane(stream.topic, messages[order, 0], messages[order, 1]))
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        members = sets[:, index]
        is_there = members != _NONE
        column = np.full(len(sets), _NONE, dtype=np.int64)
        column[is_there] = rank[np.searchsorted(numbers, members[is_there])]
        columns.append(column)
    begins, spans, latencies = sets[:, n_inputs:].T
    return Lanes(tuple(lanes), np.stack(columns, axis=1), begins, spans, latencies, astray, each)


def _sets(group: GroupAnalysis, origin: int, begin: int) -> Iterator[_Sets]:
    """Yield all sets, many at a time."""
    n_inputs, repeats = len(group.streams), group.group.options.repeats
    offsets = np.array(_offsets(group), dtype=np.int64)
    # Of each input the messages so far, the stamp of the last of them and when it was made.
    before = [(0, 0, 0)] * n_inputs
    for rows in group.evaluation.sets.rows.blocks():
        stamps, (left, latencies, spans) = rows[:, :n_inputs], rows[:, n_inputs:].T
        missing = stamps == UNREADABLE
        times = np.where(missing, 0, stamps) + offsets - origin
        latest = np.max(np.where(missing, np.iinfo(np.int64).min, times), axis=1)
        complete = left - latencies - begin
        is_astray = np.abs(latest - complete) > _ASTRAY
        times = np.where(is_astray[:, None], times - latest[:, None] + complete[:, None], times)
        begins = np.min(np.where(missing, np.iinfo(np.int64).max, times), axis=1)
        numbers, made = np.full(stamps.shape, _NONE, dtype=np.int64), times.copy()
        for index, (count, last, last_made) in enumerate(before):
            there = np.flatnonzero(~missing[:, index])
            if not len(there):
                continue
            # A message that serves many sets stands in its lane once.
            own = stamps[there, index]
            is_new = np.diff(own, prepend=last if count else own[:1] - 1) != 0 if repeats else np.ones(len(own), bool)
            numbers[there, index] = of_own = count - 1 + np.cumsum(is_new)
            first = np.maximum.accumulate(np.where(is_new, np.arange(len(own)), _NONE))
            made[there, index] = of_made = np.where(first == _NONE, last_made, times[there, index][first])
            before[index] = int(of_own[-1]) + 1, int(own[-1]), int(of_made[-1])
        yield _Sets(numbers, made, begins, spans, latencies, int(np.count_nonzero(is_astray[:, None] & ~missing)))


def _usual_delay(group: GroupAnalysis) -> int:
    """Return how long after its stamp, offset included, a message was usually received."""

    def delays() -> Iterator[Nanoseconds]:
        for offset, stream in zip(_offsets(group), group.streams, strict=True):
            yield from (received - stamps - offset for stamps, received, _ in stream.as_received().stamped())

    return quantiles(delays, [0.5])[0] if extent(delays)[0] else 0


def _offsets(group: GroupAnalysis) -> list[int]:
    """Return the offsets of the inputs, limited to what can be drawn: a file may have offsets of centuries."""
    return [max(-_LARGEST_OFFSET, min(_LARGEST_OFFSET, topic.offset_ns)) for topic in group.group.topics]


def _dropped(
    group: GroupAnalysis,
    index: int,
    origin: int,
    begin: int,
    are_kept: Callable[[Nanoseconds], npt.NDArray[np.bool_]],
) -> tuple[Nanoseconds, int]:
    """Return of an input's dropped messages that are kept when they were made and their fates; how many are astray."""
    of_reasons = np.array([CODES[reason.value] for reason in REASONS], dtype=np.int64)
    found, astray = [np.zeros((0, 2), dtype=np.int64)], 0
    for first, rows in group.evaluation.drops.numbered():
        of_input = rows[:, 0] == index
        _, stamps, received, reasons = rows[of_input].T
        times = stamps - origin + _offsets(group)[index]
        is_astray = (stamps == 0) | (np.abs(times - received + begin) > _ASTRAY)
        codes = of_reasons[reasons]
        codes[group.unneeded.flags[first : first + len(rows)][of_input]] = CODES[UNNEEDED]
        made = np.where(is_astray, received - begin, times)
        found.append(np.stack([made, codes], axis=1)[are_kept(made)])
        astray += int(np.count_nonzero(is_astray))
    return np.concatenate(found), astray
