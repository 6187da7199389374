"""Which dropped messages were not needed: an input's drops cost no more sets than there were to miss.

Each set takes a message of every input that may set the pace. So no more sets were missed than messages are left over
of the one that has fewest left over, and what faster inputs dropped beyond that could not have been in any set.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from syncrelay.sync.messages import DropReason

# What is left of an input's drops is the most telling: these are taken for not needed first.
_IN_ORDER: Final = (
    DropReason.SHUTDOWN,
    DropReason.SUPERSEDED,
    DropReason.TOO_FAR,
    DropReason.EXPIRED,
    DropReason.OVERFLOW,
)
FOR_WANT_OF_A_PARTNER: Final = frozenset(_IN_ORDER)
"""What matching gives for a message that found no partner. The other reasons are faults of its stamp, or asked for."""
# A message that came too late would have had partners.
_MISSED: Final = FOR_WANT_OF_A_PARTNER | {DropReason.LATE}


@dataclass(frozen=True, slots=True)
class DropFates:
    """The `dropped` messages of an input by reason, and the `others` of them: those but for what was not needed.

    `lacking` are the inputs that had no message left to pair with those that were not needed.
    """

    dropped: Mapping[DropReason, int]
    others: Mapping[DropReason, int]
    lacking: tuple[int, ...] = ()

    @property
    def unneeded(self) -> int:
        """How many were not needed."""
        return sum(self.dropped.values()) - sum(self.others.values())

    @property
    def mostly_unneeded(self) -> frozenset[DropReason]:
        """The reasons of which most drops were not needed."""
        return frozenset(reason for reason, count in self.dropped.items() if 2 * self.others.get(reason, 0) < count)

    @property
    def all_unneeded(self) -> frozenset[DropReason]:
        """The reasons of which no drop was needed."""
        return frozenset(self.dropped.keys() - self.others.keys())


def may_set_pace(needed: Sequence[int], *, trigger: int | None, by_clock: bool) -> tuple[int, ...]:
    """Return the inputs that may set the pace: the trigger, or the needed ones; none where a clock makes the sets."""
    if by_clock:
        return ()
    return tuple(needed) if trigger is None else (trigger,)


def drop_fates(dropped: Sequence[Mapping[DropReason, int]], counted: Sequence[int]) -> tuple[DropFates, ...]:
    """Return what became of the dropped messages of each input; `counted` are those that may set the pace.

    Where there are none, only what gave way to a newer message of its input is known to have cost no set.
    """
    if not counted:
        return tuple(DropFates(each, _without(each, each.get(DropReason.SUPERSEDED, 0))) for each in dropped)
    missed = [sum(count for reason, count in dropped[index].items() if reason in _MISSED) for index in counted]
    fewest = min(missed)
    lacking = [index for index, count in zip(counted, missed, strict=True) if count == fewest]
    return tuple(
        DropFates(
            each,
            _without(each, sum(each.get(reason, 0) for reason in _IN_ORDER) - fewest),
            tuple(other for other in lacking if other != index)[:1],
        )
        for index, each in enumerate(dropped)
    )


def _without(dropped: Mapping[DropReason, int], unneeded: int) -> dict[DropReason, int]:
    others = dict(dropped)
    for reason in _IN_ORDER:
        taken = max(0, min(unneeded, others.get(reason, 0)))
        unneeded -= taken
        if taken:
            others[reason] -= taken
    return {reason: count for reason, count in others.items() if count}
