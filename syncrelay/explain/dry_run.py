"""A group's engine driven through messages in the order of their receipt, each at its time, as the relay drives it."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, TypeAlias

from syncrelay.config import GroupConfig
from syncrelay.sync import DropReason, InputCounts, Match, Message, Outcome

Take: TypeAlias = Callable[[Sequence[Outcome], int], None]
"""Told of what leaves together, and at what time, in nanoseconds of receipt."""


class EngineDriver:
    """Drives an engine of its own through one group's messages; times of receipt are the only clock."""

    def __init__(self, group: GroupConfig, take: Take) -> None:
        self.engine: Final = group.engine()
        # Without max_wait nothing is ever due, and asking for each message costs a tenth of a replay.
        self.has_deadlines: Final = group.options.max_wait is not None
        self._take = take

    def add(self, message: Message, *, now: int) -> None:
        """Add a message after all that is due before it."""
        if self.has_deadlines:
            self.expire(now)
        outcomes = self.engine.add(message, now=now)
        if outcomes:
            self._take(outcomes, now)

    def reject(self, index: int, payload: Any, *, now: int) -> None:
        """Count a message of which no stamp or key could be read."""
        self.expire(now)
        self._take([self.engine.reject(Message(index, 0, payload), DropReason.MALFORMED)], now)

    def feed(self, arrival: "Arrival") -> None:
        """Add an arrival, or count it as malformed; the message's payload is the time when it was received."""
        index, stamp, received, key = arrival
        if stamp is None:
            self.reject(index, received, now=received)
        else:
            self.add(Message(index, stamp, received, key), now=received)

    def expire(self, now: int) -> None:
        """Let what has waited long enough leave, each at its own time, up to `now`."""
        while (deadline := self.engine.next_deadline()) is not None and deadline <= now:
            self._take(self.engine.expire(now=deadline), deadline)

    def finish(self, now: int) -> None:
        """Let all leave that may: what still waits has a deadline, or will never have a partner."""
        while (deadline := self.engine.next_deadline()) is not None:
            self._take(self.engine.expire(now=deadline), deadline)
            now = max(now, deadline)
        self._take(self.engine.flush(DropReason.SHUTDOWN), now)


class Arrival(NamedTuple):
    """A message as it came: its input, its stamp, None where none could be read, when it was received, its key."""

    input: int
    stamp: int | None
    received: int
    key: Hashable = None


@dataclass(frozen=True, slots=True)
class DryRun:
    """What a group would have made of messages.

    `spans` are those of its sets, offsets added, in nanoseconds; `held` is how many of them have each input.
    """

    sets: int
    counts: tuple[InputCounts, ...]
    spans: tuple[int, ...]
    held: tuple[int, ...]


def dry_run(group: GroupConfig, arrivals: Iterable[Arrival]) -> DryRun:
    """Return what a group would have made of messages that came in this order, with nobody waiting at the end."""
    spans: list[int] = []
    held = [0] * len(group.topics)
    offsets = [topic.offset_ns for topic in group.topics]

    def take(outcomes: Sequence[Outcome], _now: int) -> None:
        for outcome in outcomes:
            if isinstance(outcome, Match):
                there = [each for each in outcome.messages if each is not None]
                stamps = [each.stamp + offsets[each.input] for each in there]
                spans.append(max(stamps) - min(stamps))
                for each in there:
                    held[each.input] += 1

    driver = EngineDriver(group, take)
    now = 0
    for arrival in arrivals:
        now = arrival.received
        driver.feed(arrival)
    driver.finish(now)
    return DryRun(driver.engine.sets, driver.engine.counts(), tuple(spans), tuple(held))
