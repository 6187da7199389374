"""What is known of a running relay at one moment: plain values for the summary, the demo and diagnostics."""

from dataclasses import dataclass

from syncrelay.explain import RecentDrop, RecentSet
from syncrelay.sync.counts import InputCounts


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
