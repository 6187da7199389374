"""A group at one moment: what is known, what follows from it, what happened last."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.findings import Finding
from syncrelay.explain.judge import with_ok
from syncrelay.sync.messages import DropReason


class RecentSet(NamedTuple):
    """A set that left: its messages' stamps as they came in nanoseconds, in input order, None where one was missing."""

    stamps: tuple[int | None, ...]

    def shifted(self, offsets: Sequence[int]) -> Self:
        """Return it with each input's offset added, in nanoseconds, as for matching."""
        pairs = zip(self.stamps, offsets, strict=True)
        return self._replace(stamps=tuple(None if stamp is None else stamp + offset for stamp, offset in pairs))


class RecentDrop(NamedTuple):
    """A message that left unmatched; its stamp as it came, in nanoseconds."""

    input: int
    stamp: int
    reason: DropReason

    def shifted(self, offsets: Sequence[int]) -> Self:
        """Return it with its input's offset added, in nanoseconds, as for matching."""
        return self._replace(stamp=self.stamp + offsets[self.input])


def recent(last: Iterable[tuple[int | None, ...] | RecentDrop]) -> tuple[RecentSet | RecentDrop, ...]:
    """Return what left last, sets by their stamps alone, for those who are told of it."""
    return tuple(each if isinstance(each, RecentDrop) else RecentSet(each) for each in last)


@dataclass(frozen=True)
class GroupReport:
    """What there is to say of a group, in words only for those who ask; what left `last`, oldest first."""

    facts: GroupFacts
    problems: tuple[Finding, ...]
    last: Sequence[tuple[int | None, ...] | RecentDrop] = ()

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, one at least."""
        return with_ok(self.facts, self.problems)

    @cached_property
    def recent(self) -> tuple[RecentSet | RecentDrop, ...]:
        """What left last, oldest first."""
        return recent(self.last)
