"""A group at one moment: what is known, what follows from it, what happened last."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.findings import Finding
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


@dataclass(frozen=True, slots=True)
class GroupReport:
    """What there is to say of a group; what happened last, oldest first."""

    facts: GroupFacts
    findings: tuple[Finding, ...]
    recent: tuple[RecentSet | RecentDrop, ...] = ()
