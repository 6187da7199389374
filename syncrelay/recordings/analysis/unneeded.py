"""Where the messages of each input went, and which dropped ones cost no set: no partner was left for them."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from syncrelay.config import GroupConfig
from syncrelay.explain import FOR_WANT_OF_A_PARTNER, UNREADABLE
from syncrelay.explain.nearest import shifted
from syncrelay.recordings.analysis.evaluation import REASONS, Evaluation, numbers_of
from syncrelay.recordings.bag.columns import Nanoseconds
from syncrelay.sync import DropReason

_Flags: TypeAlias = npt.NDArray[np.bool_]

# These could not have been a partner: no stamp, a newer message in their place, a set that was thinned.
_NO_PARTNER: Final = frozenset({DropReason.MALFORMED, DropReason.UNSTAMPED, DropReason.DUPLICATE, DropReason.THINNED})


@dataclass(frozen=True, slots=True)
class Unneeded:
    """Which of an evaluation's drops cost no set, in their order.

    `lacking` are, for each input, the inputs that had no partner left for those of its messages: one where one is
    enough to tell why.
    """

    flags: _Flags
    lacking: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True)
class InputFates:
    """One input: messages received, in sets, not needed, and the other drops by reason.

    `lacking` are the topics that had no message left to pair with those that were not needed.
    """

    topic: str
    received: int
    matched: int
    unneeded: int
    dropped: Mapping[DropReason, int]
    lacking: tuple[str, ...]


def input_fates(group: GroupConfig, evaluation: Evaluation, unneeded: Unneeded) -> tuple[InputFates, ...]:
    """Return where the messages of each input went."""
    without_cost: Counter[int] = Counter()
    costly: list[Counter[DropReason]] = [Counter() for _ in group.topics]
    begin = 0
    for rows in evaluation.drops.rows.blocks():
        flags = unneeded.flags[begin : begin + len(rows)]
        begin += len(rows)
        kinds, first, counts = np.unique(
            2 * (rows[:, 0] * len(REASONS) + rows[:, 3]) + flags, return_index=True, return_counts=True
        )
        # Those that are equally many stand in the order in which they first occurred.
        for at in np.argsort(first).tolist():
            of, is_unneeded = divmod(int(kinds[at]), 2)
            index, number = divmod(of, len(REASONS))
            if is_unneeded:
                without_cost[index] += int(counts[at])
            else:
                costly[index][REASONS[number]] += int(counts[at])
    topics = [topic.topic for topic in group.topics]
    return tuple(
        InputFates(
            topic=topics[index],
            received=counts.fed,
            matched=counts.matched,
            unneeded=without_cost[index],
            dropped=costly[index],
            lacking=tuple(topics[other] for other in unneeded.lacking[index]),
        )
        for index, counts in enumerate(evaluation.counts)
    )


def find_unneeded(group: GroupConfig, evaluation: Evaluation, reach: int | None) -> Unneeded:
    """Return which drops cost no set.

    A message that was dropped for want of a partner is not needed where, for one of the other required inputs at
    least, each message within `reach` of its stamp, offsets included, had gone into a set with another message of its
    input, or there is none. `reach` is the span of the widest possible set; None where possible sets are not known:
    then no message is called unneeded. But where a clock makes the sets, each message is that gave way to a newer one.
    """
    of, stamps, _, reasons = evaluation.drops.rows[:].T
    flags = np.isin(reasons, numbers_of([DropReason.SUPERSEDED] if group.ticks is not None else []))
    lacking: list[tuple[int, ...]] = [() for _ in group.topics]
    if reach is None:
        return Unneeded(flags, tuple(lacking))
    needed = group.enough([counts.fed for counts in evaluation.counts])
    for index in range(len(group.topics)):
        places = np.flatnonzero((of == index) & np.isin(reasons, numbers_of(FOR_WANT_OF_A_PARTNER)))
        wanting = shifted(stamps[places], group.topics[index].offset_ns)
        others = [each for each in needed if each != index]
        lacks = {each: ~_has_near(wanting, _left_over(group, evaluation, each, index), reach) for each in others}
        if not lacks:
            continue
        is_unneeded = np.any(np.stack(list(lacks.values())), axis=0)
        flags[places] = is_unneeded
        lacking[index] = _lacking_inputs(lacks, is_unneeded)
    return Unneeded(flags, tuple(lacking))


def _left_over(group: GroupConfig, evaluation: Evaluation, index: int, wanting: int) -> Nanoseconds:
    """Return the stamps, sorted, of an input's messages that are in no set with a message of the wanting input."""
    drops, sets = evaluation.drops.rows[:].T, evaluation.sets.rows[:].T
    dropped = drops[1, (drops[0] == index) & ~np.isin(drops[3], numbers_of(_NO_PARTNER))]
    without = sets[index, (sets[wanting] == UNREADABLE) & (sets[index] != UNREADABLE)]
    return np.sort(shifted(np.concatenate([dropped, without]), group.topics[index].offset_ns))


def _has_near(stamps: Nanoseconds, others: Nanoseconds, reach: int) -> _Flags:
    if not len(others):
        return np.zeros(len(stamps), dtype=np.bool_)
    at = np.searchsorted(others, stamps - reach, side="left")
    near: _Flags = (at < len(others)) & (others[np.minimum(at, len(others) - 1)] <= stamps + reach)
    return near


def _lacking_inputs(lacks: dict[int, _Flags], is_unneeded: _Flags) -> tuple[int, ...]:
    lacking = [index for index, flags in lacks.items() if flags.any()]
    enough = [index for index in lacking if np.array_equal(lacks[index], is_unneeded)]
    return tuple(enough[:1] or lacking)
