"""How wide a tolerance should be for the sets that there could be: one that will hold, and lets in no others."""

from collections.abc import Sequence
from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from syncrelay.config import Distance
from syncrelay.explain import words
from syncrelay.explain.nearest import period_of, quantile, signed_distances
from syncrelay.explain.possible_sets import PossibleSets
from syncrelay.explain.rows import Column

_SECOND: Final = 1_000_000_000
# Beyond the usual widest span, this share of what spans scatter by, and more of few: their widest are still to come.
_HEADROOM: Final = 0.5
_OF_FEW: Final = 2.0
# What is farther away than this share of a period has another on the other side that is less than half as far again.
_CLEARLY: Final = 0.4
_TIGHT: Final = 0.1
# Distances that change by so many standard errors do so, and those that do not may, by this many. By a normal
# distribution, a standard deviation is so many times the median distance from the median.
_EVIDENT: Final = 5.0
_MAY: Final = 2.0
_OF_MEDIAN: Final = 1.5
_FEWEST: Final = 6
# Two oscillators are hardly ever farther off each other than this.
_USUAL_RATE: Final = 100e-6
# A value that holds for less than this is none.
_HOLDS: Final = 60 * _SECOND
# Half a period and a little: no message is farther from the nearest of a steady input.
_HALF: Final = 0.525
# Inputs that come so many times in a period of the slowest are quick beside it.
_OFTEN: Final = 10


class Wander(NamedTuple):
    """How fast the distances between the messages of two inputs change, without unit, and the standard error of that.

    Of inputs that one trigger starts they do not. Those that run free come as far apart as half a period in the end.
    """

    rate: float
    error: float

    @property
    def is_evident(self) -> bool:
        """Whether they change, and not by chance."""
        return self.rate > _EVIDENT * self.error

    @property
    def in_a_minute(self) -> float:
        """How far they may change in a minute, in nanoseconds: a value that holds for less is none."""
        return _HOLDS * min(_USUAL_RATE, self.rate + _MAY * self.error)


def wander(stamps: Column, others: Column) -> Wander:
    """Measure the distances from the stamps of an input to the nearest of another, both in order."""
    distances = signed_distances(stamps, others)
    if len(distances) < _FEWEST:
        return Wander(0.0, _USUAL_RATE)
    halves = np.array_split(distances, 2)
    middles = [quantile(each, 0.5) for each in halves]
    strays = max(quantile(np.abs(each - middle), 0.5) for each, middle in zip(halves, middles, strict=True))
    took = max(1, int(stamps[-1] - stamps[0])) / 2
    error = _OF_MEDIAN * strays * sqrt(2 / len(halves[-1]))
    return Wander(abs(middles[1] - middles[0]) / took, error / took)


def with_headroom(spans: Column) -> str:
    """Return the duration, as it stands in the file, that 99 % of spans keep to, and headroom by how they scatter."""
    return words.at_least(quantile(spans, 0.99) + _headroom(spans))


def _headroom(spans: Column) -> int:
    scatter = quantile(spans, 0.99) - quantile(spans, 0.5)
    return round(scatter * (_HEADROOM + _OF_FEW / sqrt(len(spans))))


def are_amid(stamps: Column, others: Column) -> bool:
    """Whether even those stamps that are nearest to others lie amid two of these."""
    distances = np.abs(signed_distances(stamps, others))
    return len(distances) > 0 and quantile(distances, _TIGHT) > _CLEARLY * period_of(others) > 0


def _others_as_near(spans: Column, periods: Sequence[float]) -> bool:
    """Whether other sets are about as near, and it matters which leave.

    It does not where the quick inputs run free of the slow ones: their messages lie up to half a period away, and are
    all of nearly the same moment.
    """
    quick, tight = min(periods), quantile(spans, _TIGHT)
    run_free = tight <= _HALF * quick and _OFTEN * quick <= max(periods)
    return tight > _CLEARLY * quick > 0 and not run_free


def tolerances(possible: PossibleSets, stamps: Sequence[Column], distance: Distance) -> tuple[str, ...]:
    """Return durations to try, of sets whose inputs have these stamps in order; none where others are about as near."""
    if distance is not Distance.SPAN or possible.is_alone:
        return tuple(dict.fromkeys((with_headroom(possible.spans), words.at_least(possible.widest))))
    pivot = stamps[possible.among.index(possible.pivot)]
    others = [each for each in stamps if each is not pivot]
    if _others_as_near(possible.spans, [period_of(each) for each in stamps]):
        return ()
    wanders = [wander(pivot, each) for each in others]
    room, more = _headroom(possible.spans), sum(each.in_a_minute for each in wanders)
    narrow, most = possible.widest + more, round(_HALF * sum(map(period_of, others)))
    if more > room and any(each.is_evident for each in wanders):
        return (words.at_least(max(most, possible.widest)),)
    wide = quantile(possible.spans, 0.99) + room + more
    return tuple(dict.fromkeys(words.at_least(round(max(possible.widest, min(most, each)))) for each in (wide, narrow)))
