"""What a group of a file would make of the messages of a recording, one by one: the engine itself is run on them."""

from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from syncrelay.config import GroupConfig
from syncrelay.explain import UNREADABLE, EngineDriver
from syncrelay.explain.nearest import extents
from syncrelay.explain.rows import BLOCK, Column, Rows
from syncrelay.recordings.analysis.streams import Stream, messages, transforms_beside
from syncrelay.sync import DropReason, InputCounts, Lapse, Match, Outcome

REASONS: Final = tuple(DropReason)
"""What the numbers in the rows of drops stand for."""

_NUMBERS: Final = {reason: number for number, reason in enumerate(REASONS)}
_LONGEST: Final = 2**63 - 1


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


class Sets:
    """All sets, in the order in which they left.

    A row is the stamps in input order, UNREADABLE where one is missing, when the set left, its latency and its span.
    """

    def __init__(self, n_inputs: int) -> None:
        self.n_inputs: Final = n_inputs
        self.rows: Final = Rows(n_inputs + 3)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def left(self) -> Column:
        """When they left."""
        return self.rows.column(self.n_inputs)

    @property
    def latencies(self) -> Column:
        """How long they waited when they were complete."""
        return self.rows.column(self.n_inputs + 1)

    @property
    def spans(self) -> Column:
        """How far apart their stamps are, offsets included."""
        return self.rows.column(self.n_inputs + 2)

    def __iter__(self) -> Iterator[SetOut]:
        for rows in self.rows.blocks():
            for *stamps, left, latency, span in rows.tolist():
                yield SetOut(tuple(None if each == UNREADABLE else each for each in stamps), left, span, latency)


class Drops:
    """All messages that left unmatched, in their order.

    A row is the input, the stamp, the time of receipt and the number of the reason.
    """

    def __init__(self) -> None:
        self.rows: Final = Rows(4)

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[DropOut]:
        for rows in self.rows.blocks():
            for index, stamp, received, number in rows.tolist():
                yield DropOut(index, stamp, received, REASONS[number])


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What a group made of the streams of its inputs."""

    counts: tuple[InputCounts, ...]
    sets: Sets
    drops: Drops
    lapses: tuple[Lapse, ...] = ()


def numbers_of(reasons: Iterable[DropReason]) -> list[int]:
    """Return the numbers that stand for reasons in the rows of drops."""
    return [_NUMBERS[reason] for reason in reasons]


class _Outcomes:
    """Takes what leaves an engine; the payload of a message is the time when it was received."""

    def __init__(self, group: GroupConfig) -> None:
        self.sets: Final = Sets(len(group.topics))
        self.drops: Final = Drops()
        self._offsets = [topic.offset_ns for topic in group.topics]
        self._new_sets, self._new_drops = array("q"), array("q")

    def take(self, outcomes: Sequence[Outcome], now: int) -> None:
        """Take what leaves together."""
        for outcome in outcomes:
            if isinstance(outcome, Match):
                complete = 0
                for message in outcome.messages:
                    if message is None:
                        self._new_sets.append(UNREADABLE)
                    else:
                        self._new_sets.append(message.stamp)
                        complete = max(complete, message.payload)
                self._new_sets.append(min(now, _LONGEST))
                self._new_sets.append(min(now - complete, _LONGEST))
            else:
                message = outcome.message
                self._new_drops.extend((message.input, message.stamp, message.payload, _NUMBERS[outcome.reason]))
        if len(self._new_sets) > BLOCK or len(self._new_drops) > BLOCK:
            self.flush()

    def flush(self) -> None:
        """Have all in the rows."""
        new = np.frombuffer(self._new_sets, dtype=np.int64).reshape(-1, len(self._offsets) + 2)
        begins, ends = extents(new[:, : len(self._offsets)], self._offsets)
        self.sets.rows.append(np.concatenate([new, (ends - begins)[:, None]], axis=1))
        self.drops.rows.append(np.array(self._new_drops, dtype=np.int64).reshape(-1, 4))
        self._new_sets, self._new_drops = array("q"), array("q")


def evaluate(group: GroupConfig, streams: Sequence[Stream]) -> Evaluation:
    """Return what a group makes of the streams of its inputs."""
    outcomes = _Outcomes(group)
    driver = EngineDriver(group, outcomes.take, transforms_beside(streams))
    driver.run(messages(streams))
    outcomes.flush()
    return Evaluation(driver.engine.counts(), outcomes.sets, outcomes.drops, tuple(driver.engine.lapses))
