"""Where the messages of a group stand on a line of time, what became of each, and which are a set."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from syncrelay.explain import UNREADABLE
from syncrelay.recordings.analysis import GroupAnalysis
from syncrelay.recordings.analysis.evaluation import REASONS
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


def lanes_of(group: GroupAnalysis, begin: int, *, most: int) -> Lanes:
    """Return the lanes of a group in a recording that begins at `begin`, with about `most` messages."""
    delay = _usual_delay(group)
    origin = begin - delay
    sets = group.evaluation.sets
    stamps = sets.rows[:][:, : sets.n_inputs]
    missing = stamps == UNREADABLE
    offsets = _offsets(group)
    times = np.where(missing, 0, stamps) + np.array(offsets, dtype=np.int64) - origin
    latest = np.max(np.where(missing, np.iinfo(np.int64).min, times), axis=1, initial=np.iinfo(np.int64).min)
    complete = sets.left[:] - sets.latencies[:] - begin
    is_astray = np.abs(latest - complete) > _ASTRAY
    times = np.where(is_astray[:, None], times - latest[:, None] + complete[:, None], times)

    lanes, places, astray = [], [], int(np.count_nonzero(is_astray[:, None] & ~missing))
    for index, stream in enumerate(group.streams):
        there = ~missing[:, index]
        # A message that serves many sets stands in its lane once.
        is_new = _is_new(stamps[there, index]) if group.group.options.repeats else np.ones(there.sum(), bool)
        first, which = np.flatnonzero(is_new), np.cumsum(is_new) - 1
        matched = times[there, index][first]
        dropped, codes, n_astray = _dropped(group, index, origin - offsets[index], begin)
        astray += n_astray
        all_times = np.concatenate([matched, dropped])
        all_codes = np.concatenate([np.full(len(matched), CODES[MATCHED], dtype=np.int64), codes])
        order = np.argsort(all_times, kind="stable")
        lanes.append(Lane(stream.topic, all_times[order], all_codes[order]))
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        column = np.full(len(sets), _NONE, dtype=np.int64)
        column[there] = rank[which]
        places.append(column)
    begins = np.min(np.where(missing, np.iinfo(np.int64).max, times), axis=1, initial=np.iinfo(np.int64).max)
    by_begin = np.argsort(begins, kind="stable")
    found = Lanes(
        lanes=tuple(lanes),
        members=np.stack(places, axis=1)[by_begin],
        begins=begins[by_begin],
        spans=sets.spans[:][by_begin],
        latencies=sets.latencies[:][by_begin],
        astray=astray,
        each=1,
    )
    return _thinned(found, most)


def _is_new(stamps: Nanoseconds) -> npt.NDArray[np.bool_]:
    """Return which stamps, in the order of the sets, are of another message than that of the set before."""
    is_new: npt.NDArray[np.bool_] = np.diff(stamps, prepend=stamps[:1] - 1) != 0
    return is_new


def _usual_delay(group: GroupAnalysis) -> int:
    """Return how long after its stamp, offset included, a message was usually received."""
    delays = []
    for offset, stream in zip(_offsets(group), group.streams, strict=True):
        stamps, received, _ = stream.arrays()
        is_set = (stamps != 0) & (stamps != UNREADABLE)
        delays.append(received[is_set] - stamps[is_set] - offset)
    every = np.concatenate(delays)
    return int(np.quantile(every, 0.5, method="inverted_cdf")) if len(every) else 0


def _offsets(group: GroupAnalysis) -> list[int]:
    """Return the offsets of the inputs, limited to what can be drawn: a file may have offsets of centuries."""
    return [max(-_LARGEST_OFFSET, min(_LARGEST_OFFSET, topic.offset_ns)) for topic in group.group.topics]


def _dropped(group: GroupAnalysis, index: int, origin: int, begin: int) -> tuple[Nanoseconds, Nanoseconds, int]:
    """Return when the dropped messages of an input were made, the codes of their fates, and how many are astray."""
    rows = group.evaluation.drops.rows[:]
    of_input = rows[:, 0] == index
    _, stamps, received, reasons = rows[of_input].T
    times = stamps - origin
    is_astray = (stamps == 0) | (np.abs(times - received + begin) > _ASTRAY)
    codes = np.array([CODES[reason.value] for reason in REASONS], dtype=np.int64)[reasons]
    codes[group.unneeded.flags[of_input]] = CODES[UNNEEDED]
    return np.where(is_astray, received - begin, times), codes, int(np.count_nonzero(is_astray))


def _thinned(found: Lanes, most: int) -> Lanes:
    """Keep whole stretches, evenly spread, where there is more than the page can hold."""
    messages = sum(len(lane.times) for lane in found.lanes)
    if messages <= most:
        return found
    each = -(-messages // most)
    kept_sets = found.begins // _STRETCH % each == 0
    lanes, columns = [], []
    for index, lane in enumerate(found.lanes):
        places = found.members[kept_sets, index]
        kept = lane.times // _STRETCH % each == 0
        # A set is whole even where it reaches out of its stretch.
        kept[places[places != _NONE]] = True
        rank = np.cumsum(kept) - 1
        columns.append(np.where(places == _NONE, _NONE, rank[places]))
        lanes.append(replace(lane, times=lane.times[kept], fates=lane.fates[kept]))
    return replace(
        found,
        lanes=tuple(lanes),
        members=np.stack(columns, axis=1),
        begins=found.begins[kept_sets],
        spans=found.spans[kept_sets],
        latencies=found.latencies[kept_sets],
        each=each,
    )
