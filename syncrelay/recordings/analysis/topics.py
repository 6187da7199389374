"""Figures of one topic: its rhythm, the faults of its stamps, and its stamps against the times of receipt."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from syncrelay.explain import UNREADABLE
from syncrelay.explain.clocks import drift
from syncrelay.explain.nearest import in_order
from syncrelay.explain.rows import Column, Rows, Stretches, blocks, extent, median, quantiles, steps
from syncrelay.recordings.analysis.streams import Stream
from syncrelay.recordings.bag.columns import Nanoseconds

_SECOND: Final = 1_000_000_000
# A period so many times the usual one is a gap: one message or more is missing.
_GAP: Final = 1.5
_DRIFT_POINTS: Final = 300
# Below it drift is noise: so long watched, so much more than it bends.
_DRIFT_WATCHED: Final = 20 * _SECOND
_DRIFT_BENDS: Final = 8


@dataclass(frozen=True, slots=True)
class Spread:
    """A quantity in nanoseconds: the least, the median, the 5th and the 95th percentile, the greatest."""

    least: int
    low: int
    median: int
    high: int
    greatest: int


@dataclass(frozen=True, slots=True)
class TopicFigures:
    """One topic. `period` is the median time between two stamps, `jitter` the 95th percentile of how far one is off it.

    `delay` is the time of receipt minus the stamp; beyond a second, it is the distance of two clocks. `drift_ppm` is
    how much slower than the recorder's clock the stamps run. What cannot be known from the messages is None.
    """

    topic: str
    type: str
    messages: int
    rate_hz: float
    period: int | None
    jitter: int | None
    least_period: int | None
    gaps: int
    longest_gap: int | None
    duplicates: int
    out_of_order: int
    unstamped: int
    unreadable: int
    delay: Spread | None
    drift_ppm: float | None


def figures_of(stream: Stream) -> TopicFigures:
    """Return the figures of a topic's stream, once all is read."""
    figures: TopicFigures = stream.kept.get("figures") or _figures(stream)
    stream.kept["figures"] = figures
    return figures


def _figures(stream: Stream) -> TopicFigures:
    stamps, received = stream.stamps, stream.received
    unstamped = sum(int(np.count_nonzero(some == 0)) for some in blocks(stamps))
    unreadable = sum(int(np.count_nonzero(some == UNREADABLE)) for some in blocks(stamps))
    messages = stream.as_received()
    if unstamped or unreadable:
        kept = Rows(2)
        for some, at, _ in messages.stamped():
            kept.append(np.stack([some, at], axis=1))
        stamps, received = kept.column(0), kept.column(1)
    # Of a topic without stamps, the arrivals tell the rhythm.
    distinct = in_order(messages, 0).stamps if len(stamps) else _distinct(stream.received[:])

    def delays() -> Iterator[Nanoseconds]:
        return (at - some for some, at in zip(blocks(stamps), blocks(received), strict=True))

    def periods() -> Iterator[Nanoseconds]:
        return steps(distinct)

    count, least, most = extent(periods)
    usual = int(median(periods)) if count else None
    far = _GAP * usual if usual else most
    gaps = sum(int(np.count_nonzero(some > far)) for some in periods())
    is_delayed = len(stamps) and any(some.any() for some in delays())
    return TopicFigures(
        topic=stream.topic,
        type=stream.type,
        messages=len(stream.stamps),
        rate_hz=count * _SECOND / int(distinct[-1] - distinct[0]) if count else 0.0,
        period=usual,
        jitter=quantiles(lambda: (np.abs(some - usual) for some in periods()), [0.95])[0]
        if usual is not None
        else None,
        least_period=least if count else None,
        gaps=gaps,
        longest_gap=most if gaps else None,
        duplicates=len(stamps) - len(distinct) if len(stamps) else 0,
        out_of_order=sum(int(np.count_nonzero(some < 0)) for some in steps(stamps)),
        unstamped=unstamped,
        unreadable=unreadable,
        delay=spread(delays) if is_delayed else None,
        drift_ppm=_drift_ppm(stamps, received),
    )


def spread(values: Stretches) -> Spread:
    """Return the spread of one value or more."""
    _, least, greatest = extent(values)
    low, middle, high = quantiles(values, (0.05, 0.5, 0.95))
    return Spread(least, low, middle, high, greatest)


def _distinct(values: Nanoseconds) -> Nanoseconds:
    """As np.unique, which since numpy 2.3 takes six times as long for what is nearly in order."""
    ordered = np.sort(values)
    return ordered[np.concatenate(([True], ordered[1:] != ordered[:-1]))[: len(ordered)]]


def _drift_ppm(stamps: Column, received: Column) -> float | None:
    """Return the drift, by the least delay of each of some hundred stretches; None where it is lost in noise."""
    if len(stamps) < _DRIFT_POINTS // 10:
        return None
    count = min(_DRIFT_POINTS, len(stamps) // 3)
    each, more = divmod(len(stamps), count)
    ends = [each * number + min(number, more) for number in range(count + 1)]
    first, points = received[0] - stamps[0], []
    for begin, end in pairwise(ends):
        at = received[begin:end]
        points.append((int(at[len(at) // 2]), int(np.min(at - stamps[begin:end] - first))))
    found = drift(points)
    if found is None or found.watched_ns < _DRIFT_WATCHED or abs(found.drifted_ns) < _DRIFT_BENDS * found.bend_ns:
        return None
    return found.slope * 1e6
