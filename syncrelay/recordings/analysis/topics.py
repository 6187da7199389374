"""Figures of one topic: its rhythm, the faults of its stamps, and its stamps against the times of receipt."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from syncrelay.explain import UNREADABLE
from syncrelay.explain.clocks import drift
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
    """Return the figures of a topic's stream."""
    stamps, received, _ = stream.arrays()
    unstamped = int(np.count_nonzero(stamps == 0))
    is_set = (stamps != 0) & (stamps != UNREADABLE)
    stamped, at = stamps[is_set], received[is_set]
    steps = np.diff(stamped)
    # Of a topic without stamps, the arrivals tell the rhythm.
    distinct = _distinct(stamped if len(stamped) else received)
    periods: Nanoseconds = np.diff(distinct)
    usual = int(np.median(periods)) if len(periods) else None
    gaps = periods[periods > _GAP * usual] if usual else periods[:0]
    return TopicFigures(
        topic=stream.topic,
        type=stream.type,
        messages=len(stamps),
        rate_hz=len(periods) * _SECOND / int(distinct[-1] - distinct[0]) if len(periods) else 0.0,
        period=usual,
        jitter=_quantile(np.abs(periods - usual), 0.95) if usual is not None else None,
        least_period=int(np.min(periods)) if len(periods) else None,
        gaps=len(gaps),
        longest_gap=int(np.max(gaps)) if len(gaps) else None,
        duplicates=len(stamped) - len(distinct) if len(stamped) else 0,
        out_of_order=int(np.count_nonzero(steps < 0)),
        unstamped=unstamped,
        unreadable=int(np.count_nonzero(stamps == UNREADABLE)),
        delay=spread(at - stamped) if len(stamped) and not np.array_equal(at, stamped) else None,
        drift_ppm=_drift_ppm(stamped, at),
    )


def spread(values: Nanoseconds) -> Spread:
    """Return the spread of one value or more."""
    low, median, high = (_quantile(values, share) for share in (0.05, 0.5, 0.95))
    return Spread(int(np.min(values)), low, median, high, int(np.max(values)))


def _distinct(values: Nanoseconds) -> Nanoseconds:
    """As np.unique, which since numpy 2.3 takes six times as long for what is nearly in order."""
    ordered = np.sort(values)
    return ordered[np.concatenate(([True], ordered[1:] != ordered[:-1]))[: len(ordered)]]


def _quantile(values: Nanoseconds, share: float) -> int:
    """Return a value that occurred: floats would lose the nanoseconds of an epoch."""
    return int(np.quantile(values, share, method="inverted_cdf"))


def _drift_ppm(stamps: Nanoseconds, received: Nanoseconds) -> float | None:
    """Return the drift, by the least delay of each of some hundred stretches; None where it is lost in noise."""
    if len(stamps) < _DRIFT_POINTS // 10:
        return None
    parts = np.array_split(np.arange(len(stamps)), min(_DRIFT_POINTS, len(stamps) // 3))
    delays = received - stamps
    points = [(int(received[part[len(part) // 2]]), int(np.min(delays[part] - delays[0]))) for part in parts]
    found = drift(points)
    if found is None or found.watched_ns < _DRIFT_WATCHED or abs(found.drifted_ns) < _DRIFT_BENDS * found.bend_ns:
        return None
    return found.slope * 1e6
