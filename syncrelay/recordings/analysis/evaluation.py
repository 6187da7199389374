"""What a group of a file would make of the messages of a recording, one by one: the engine itself is run on them."""

from collections.abc import Sequence
from dataclasses import dataclass

from syncrelay.config import GroupConfig
from syncrelay.explain import EngineDriver
from syncrelay.recordings.analysis.streams import Stream, messages, transforms_beside
from syncrelay.sync import DropReason, InputCounts, Lapse, Match, Outcome


@dataclass(frozen=True, slots=True)
class SetOut:
    """A set: its stamps in input order, when it left, its span, and how long it waited for that when complete."""

    stamps: tuple[int | None, ...]
    left: int
    span: int
    latency: int


@dataclass(frozen=True, slots=True)
class DropOut:
    """A message that left unmatched: its input, its stamp, when it was received, and why."""

    input: int
    stamp: int
    received: int
    reason: DropReason


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What a group made of the streams of its inputs."""

    counts: tuple[InputCounts, ...]
    sets: tuple[SetOut, ...]
    drops: tuple[DropOut, ...]
    lapses: tuple[Lapse, ...] = ()


class Outcomes:
    """Takes what leaves an engine."""

    def __init__(self, group: GroupConfig) -> None:
        self.sets: list[SetOut] = []
        self.drops: list[DropOut] = []
        self._offsets = [topic.offset_ns for topic in group.topics]

    def take(self, outcomes: Sequence[Outcome], now: int) -> None:
        """Take what leaves together; the payload of a message is the time when it was received."""
        for outcome in outcomes:
            if isinstance(outcome, Match):
                self.sets.append(self._set(outcome, now))
            else:
                message = outcome.message
                self.drops.append(DropOut(message.input, message.stamp, message.payload, outcome.reason))

    def _set(self, match: Match, now: int) -> SetOut:
        there = [message for message in match.messages if message is not None]
        shifted = [message.stamp + self._offsets[message.input] for message in there]
        latency = now - max(message.payload for message in there)
        return SetOut(match.stamps, now, max(shifted) - min(shifted), latency)


def evaluate(group: GroupConfig, streams: Sequence[Stream]) -> Evaluation:
    """Return what a group makes of the streams of its inputs."""
    outcomes = Outcomes(group)
    driver = EngineDriver(group, outcomes.take, transforms_beside(streams))
    driver.run(messages(streams))
    return Evaluation(driver.engine.counts(), tuple(outcomes.sets), tuple(outcomes.drops), tuple(driver.engine.lapses))
