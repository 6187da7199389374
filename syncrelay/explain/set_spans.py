"""Which of the sets that an engine gives are sets of one moment, as columns: many are looked at together."""

from array import array
from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from syncrelay.clock import UNREADABLE
from syncrelay.config import GroupConfig
from syncrelay.explain.dry_run import EngineDriver
from syncrelay.explain.nearest import Nanoseconds, extents
from syncrelay.explain.possible_sets import PossibleSets
from syncrelay.explain.rows import BLOCK
from syncrelay.sync import Match, Message, Outcome


class Run(NamedTuple):
    """The sets of one moment that a run of the engine gave: the spans that were possible, and those that they had."""

    possible: Nanoseconds
    given: Nanoseconds


NOTHING: Final = Run(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))


def match(config: GroupConfig, messages: Iterable[Message], count: Callable[[Nanoseconds], None]) -> None:
    """Have an engine's sets counted, many at a time: the stamps, UNREADABLE where one is missing, and the tick."""
    taken = array("q")

    def give() -> None:
        count(np.array(taken, dtype=np.int64).reshape(-1, len(config.topics) + 1))
        del taken[:]

    def take(outcomes: Sequence[Outcome], _now: int) -> None:
        for each in outcomes:
            if isinstance(each, Match):
                taken.extend([UNREADABLE if message is None else message.stamp for message in each.messages])
                taken.append(UNREADABLE if each.tick is None else each.tick)
        if len(taken) >= BLOCK:
            give()

    EngineDriver(config, take).run(messages)
    give()


def of_one_moment(possible: PossibleSets, config: GroupConfig, sets: Nanoseconds) -> Run:
    """Return the spans of those sets that are of one moment."""
    among = list(possible.among)
    begins, ends = extents(sets[:, among], [config.topics[index].offset_ns for index in among])
    pivots = sets[:, len(config.topics) if possible.is_at_ticks else possible.pivot]
    if config.ticks is not None:
        ends = sets[:, len(config.topics)]
    at = np.searchsorted(possible.stamps, pivots, side="right") - 1
    belong = (at >= 0) & (sets[:, among] != UNREADABLE).all(axis=1)
    belong[belong] = possible.stamps[at[belong]] == pivots[belong]
    belong &= ends - begins <= possible.widest
    return Run(possible.spans[at[belong]], (ends - begins)[belong])
