"""A group at one moment: what is known, what follows from it, what happened last."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import median_low
from typing import NamedTuple, Self

from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.finding_log import FindingLog
from syncrelay.explain.findings import Finding
from syncrelay.explain.judge import with_ok
from syncrelay.explain.standing import Standing
from syncrelay.explain.unneeded import DropFates
from syncrelay.sync.messages import DropReason


class RecentSet(NamedTuple):
    """A set that left: its messages' stamps as they came in nanoseconds, in input order, None where one was missing."""

    stamps: tuple[int | None, ...]

    def shifted(self, offsets: Sequence[int]) -> Self:
        """Return it with each input's offset added, in nanoseconds, as for matching."""
        pairs = zip(self.stamps, offsets, strict=True)
        return self._replace(stamps=tuple(None if stamp is None else stamp + offset for stamp, offset in pairs))


class RecentDrop(NamedTuple):
    """A message that left unmatched; its stamp as it came, in nanoseconds.

    `unneeded` says whether it cost no set, None where nobody has told.
    """

    input: int
    stamp: int
    reason: DropReason
    unneeded: bool | None = None

    def shifted(self, offsets: Sequence[int]) -> Self:
        """Return it with its input's offset added, in nanoseconds, as for matching."""
        return self._replace(stamp=self.stamp + offsets[self.input])


@dataclass(frozen=True)
class GroupReport:
    """What there is to say of a group, in words only for those who ask; what left `last`, oldest first."""

    facts: GroupFacts
    problems: tuple[Finding, ...]
    last: Sequence[tuple[int | None, ...] | RecentDrop] = ()
    log: FindingLog | None = None
    """What was logged of the group since the start."""

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, one at least."""
        return with_ok(self.facts, self.problems)

    @cached_property
    def recent(self) -> tuple[RecentSet | RecentDrop, ...]:
        """What left last, oldest first."""
        return tuple(self.told(each) if isinstance(each, RecentDrop) else RecentSet(each) for each in self.last)

    def told(self, drop: RecentDrop) -> RecentDrop:
        """Return a drop with whether it was needed: by what its input's drops of its reason were.

        While enough sets leave, by what most of them were. Else each may be what is to be seen, unless none was needed.
        """
        return drop._replace(unneeded=drop.reason in self._unneeded[drop.input])

    @cached_property
    def _unneeded(self) -> tuple[frozenset[DropReason], ...]:
        """Which reasons say of an input that a message was not needed: lately, or else since the start."""
        pairs = zip(self.facts.fates_lately, self.facts.fates, strict=True)
        return tuple(self._told_of(lately) | (self._told_of(whole) - lately.dropped.keys()) for lately, whole in pairs)

    def _told_of(self, fates: DropFates) -> frozenset[DropReason]:
        return fates.mostly_unneeded if self.facts.standing is Standing.ENOUGH else fates.all_unneeded

    @property
    def span_without_offsets(self) -> int | None:
        """The median span, in nanoseconds, that the last sets would have without offsets; None if there are none."""
        if not any(each.offset for each in self.facts.inputs):
            return None
        sets = (each.stamps for each in self.recent if isinstance(each, RecentSet))
        as_stamped = [[stamp for stamp in stamps if stamp is not None] for stamps in sets]
        return median_low(max(each) - min(each) for each in as_stamped) if as_stamped else None
