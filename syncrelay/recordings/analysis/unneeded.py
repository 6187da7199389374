"""Where the messages of each input went, and which dropped ones cost no set: no partner was left for them."""

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from syncrelay.config import GroupConfig
from syncrelay.explain import FOR_WANT_OF_A_PARTNER, UNREADABLE
from syncrelay.explain.feeding import REASONS, numbers_of
from syncrelay.explain.nearest import in_order, shifted
from syncrelay.explain.received import Received
from syncrelay.explain.rows import Column, Rows
from syncrelay.recordings.analysis.evaluation import Drops, Evaluation
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
    for begin, rows in evaluation.drops.numbered():
        flags = unneeded.flags[begin : begin + len(rows)]
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
    flags = np.zeros(len(evaluation.drops), dtype=np.bool_)
    superseded = numbers_of([DropReason.SUPERSEDED] if group.ticks is not None else [])
    for begin, rows in evaluation.drops.numbered():
        flags[begin : begin + len(rows)] = np.isin(rows[:, 3], superseded)
    lacking: list[tuple[int, ...]] = [() for _ in group.topics]
    if reach is None:
        return Unneeded(flags, tuple(lacking))
    needed = group.enough([counts.fed for counts in evaluation.counts])
    for index in range(len(group.topics)):
        others = {each: _left_over(group, evaluation, each, index) for each in needed if each != index}
        if others:
            lacking[index] = _flag(
                flags, evaluation.drops, index, others, offset=group.topics[index].offset_ns, reach=reach
            )
    return Unneeded(flags, tuple(lacking))


def _flag(
    flags: _Flags, drops: Drops, index: int, others: Mapping[int, Column], *, offset: int, reach: int
) -> tuple[int, ...]:
    """Flag the drops of an input that cost no set; return the inputs of which it lacked messages."""
    wanting = numbers_of(FOR_WANT_OF_A_PARTNER)
    lacking: set[int] = set()
    # Those that alone tell why.
    enough = dict.fromkeys(others)
    for begin, rows in drops.numbered():
        places = np.flatnonzero((rows[:, 0] == index) & np.isin(rows[:, 3], wanting))
        stamps = shifted(rows[places, 1], offset)
        lacks = {each: ~_has_near(stamps, those, reach) for each, those in others.items()}
        flags[begin + places] = is_unneeded = np.any(np.stack([*lacks.values()]), axis=0)
        lacking |= {each for each, its in lacks.items() if its.any()}
        enough = {each: None for each in enough if np.array_equal(lacks[each], is_unneeded)}
    return tuple([each for each in enough if each in lacking][:1] or [each for each in others if each in lacking])


def _left_over(group: GroupConfig, evaluation: Evaluation, index: int, wanting: int) -> Column:
    """Return the stamps, in order, of an input's messages that are in no set with a message of the wanting input."""
    left, no_partner = Rows(1), numbers_of(_NO_PARTNER)
    for rows in evaluation.drops.rows.blocks():
        left.append(rows[(rows[:, 0] == index) & ~np.isin(rows[:, 3], no_partner), 1:2])
    for rows in evaluation.sets.rows.blocks():
        left.append(rows[rows[:, wanting] == UNREADABLE, index : index + 1])
    stamps = left.column(0)
    return in_order(Received(stamps, stamps, stamps), group.topics[index].offset_ns).stamps


def _has_near(stamps: Nanoseconds, others: Column, reach: int) -> _Flags:
    if not len(stamps) or not len(others):
        return np.zeros(len(stamps), dtype=np.bool_)
    first = bisect_left(others, int(stamps.min()) - reach)
    around = others[first : bisect_right(others, int(stamps.max()) + reach)]
    near: _Flags = np.searchsorted(around, stamps - reach) < np.searchsorted(around, stamps + reach, side="right")
    return near
