"""What is known of a running relay at one moment: plain values for the summary, the demo and diagnostics."""

from dataclasses import dataclass
from typing import NamedTuple

from syncrelay.sync.counts import InputCounts
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
class InputSnapshot:
    """One input of a group. `publishers` counts those of the file's type that the graph shows."""

    topic: str
    output: str
    counts: InputCounts
    publishers: int
    subscribed: bool


@dataclass(frozen=True, slots=True)
class GroupSnapshot:
    """One group: its inputs in the file's order, its sets, and what happened last, oldest first."""

    name: str
    inputs: tuple[InputSnapshot, ...]
    sets: int
    recent: tuple[RecentSet | RecentDrop, ...]
    waiting_for: str | None


@dataclass(frozen=True, slots=True)
class RelaySnapshot:
    """All groups that run, in the file's order."""

    groups: tuple[GroupSnapshot, ...]
