"""A group at one moment: what is known, what follows from it, what happened last."""

from dataclasses import dataclass
from typing import NamedTuple

from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.findings import Finding
from syncrelay.sync.messages import DropReason


class RecentSet(NamedTuple):
    """A set that left: its messages' stamps as they came in nanoseconds, in input order, None where one was missing."""

    stamps: tuple[int | None, ...]


class RecentDrop(NamedTuple):
    """A message that left unmatched; its stamp as it came, in nanoseconds."""

    input: int
    stamp: int
    reason: DropReason


@dataclass(frozen=True, slots=True)
class GroupReport:
    """What there is to say of a group; what happened last, oldest first."""

    facts: GroupFacts
    findings: tuple[Finding, ...]
    recent: tuple[RecentSet | RecentDrop, ...] = ()
