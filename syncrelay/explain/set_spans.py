"""Which of the sets that an engine gives are sets of one moment, as columns: many are looked at together."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

import numpy as np

from syncrelay.clock import UNREADABLE
from syncrelay.config import GroupConfig
from syncrelay.explain.dry_run import EngineDriver
from syncrelay.explain.feeding import Left, feed
from syncrelay.explain.nearest import Nanoseconds, extents
from syncrelay.explain.possible_sets import PossibleSets
from syncrelay.explain.received import Messages
from syncrelay.explain.rows import Column, blocks, no_numbers


class Run(NamedTuple):
    """The sets of one moment that a run of the engine gave: the spans that were possible, and those that they had."""

    possible: Column
    given: Column


NOTHING: Final = Run(no_numbers(), no_numbers())


def match(config: GroupConfig, messages: Iterable[Messages], count: Callable[[Nanoseconds], None]) -> None:
    """Have an engine's sets counted, many at a time: the stamps, UNREADABLE where one is missing, and the tick."""
    now, left = 0, Left(len(config.topics))
    driver = EngineDriver(config, left.add)

    def give() -> None:
        count(left.taken()[0][:, : len(config.topics) + 1])

    for some in messages:
        now = feed(driver, some, left)
        give()
    driver.finish(now)
    give()


def of_one_moment(possible: PossibleSets, config: GroupConfig, sets: Nanoseconds) -> Nanoseconds:
    """Return those sets that are of one moment, a row each: the span that was possible, and the one that it has."""
    among = list(possible.among)
    begins, ends = extents(sets[:, among], [config.topics[index].offset_ns for index in among])
    pivots = sets[:, len(config.topics) if possible.is_at_ticks else possible.pivot]
    if config.ticks is not None:
        ends = sets[:, len(config.topics)]
    belong = (sets[:, among] != UNREADABLE).all(axis=1) & (ends - begins <= possible.widest)
    pivots, spans = pivots[belong], (ends - begins)[belong]
    first = bisect_left(possible.stamps, int(pivots.min())) if len(pivots) else 0
    around = slice(first, bisect_right(possible.stamps, int(pivots.max())) if len(pivots) else 0)
    stamps, at = possible.stamps[around], np.searchsorted(possible.stamps[around], pivots, side="right") - 1
    are_known = at >= 0
    are_known[are_known] = stamps[at[are_known]] == pivots[are_known]
    return np.stack([possible.spans[around][at[are_known]], spans[are_known]], axis=1)


def counted(spans: Column, within: int | None) -> int:
    """Return how many spans there are; of those `within` one, where it is given."""
    if within is None:
        return len(spans)
    return sum(int(np.count_nonzero(some <= within)) for some in blocks(spans))
