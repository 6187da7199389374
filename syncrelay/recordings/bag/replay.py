"""Feeds a recording to the groups of a file as the relay would have received it, with receive time as `now`."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, TypeAlias

from syncrelay.explain import UNREADABLE, EngineDriver
from syncrelay.recordings.bag.bindings import GroupBinding
from syncrelay.recordings.bag.columns import Batch, Columns, ReadColumn, column_reader, receipt_column
from syncrelay.recordings.bag.recording import Channel, RawMessage, Recording
from syncrelay.recordings.bag.transforms import TransformReader, frame_reader, transform_channels
from syncrelay.sync import InputCounts, Message, Outcome

Left: TypeAlias = tuple[GroupBinding, Sequence[Outcome], int]
"""Sets and drops of a group, and the time at which they left. A message's payload is its RawMessage."""

Listener: TypeAlias = Callable[[Sequence[Left]], None]
"""Called with what left while a batch was read: one by one, they and the engine would empty each other's caches."""

# A clock may trigger any number of sets between two messages.
_MOST_LEFT: Final = 5_000


@dataclass(frozen=True, slots=True)
class InputResult:
    """What became of the messages of one input."""

    topic: str
    counts: InputCounts


@dataclass(frozen=True, slots=True)
class GroupResult:
    """What a group made of the recording."""

    name: str
    inputs: tuple[InputResult, ...]
    sets: int


class GroupReplay:
    """One group at work on a recording."""

    def __init__(self, binding: GroupBinding, take: Callable[[Sequence[Outcome], int], None] | None) -> None:
        self.binding = binding
        self.driver: Final = EngineDriver(binding.group, take, ())

    def readers(self) -> Iterator[list[tuple[Channel, ReadColumn]]]:
        """Yield the readers of each input's channels; raises BagError for a stamp or key that a type does not have."""
        for index, each in enumerate(self.binding.inputs):
            yield [(channel, column_reader(self.binding.group, index, channel)) for channel in each.channels]

    def result(self) -> GroupResult:
        """Return the counts so far."""
        engine = self.driver.engine
        topics = (each.config.topic for each in self.binding.inputs)
        inputs = tuple(InputResult(*each) for each in zip(topics, engine.counts(), strict=True))
        return GroupResult(self.binding.group.name, inputs, engine.sets)


class Replay:
    """Groups at work on a recording, a step for each batch that is read of it."""

    def __init__(
        self, recording: Recording, bindings: Sequence[GroupBinding], *, listeners: Sequence[Listener] = ()
    ) -> None:
        """Raises BagError for a stamp or key that a recorded type does not have."""
        self._recording = recording
        self._listeners = listeners
        self._left: list[Left] = []
        self._groups = [GroupReplay(each, partial(self._take, each) if listeners else None) for each in bindings]
        awaiting = [each for each in self._groups if each.binding.group.options.transforms is not None]
        self._awaiting = [group.driver for group in awaiting]
        channels = transform_channels(recording) if awaiting else []
        self._transforms = TransformReader(channels)
        self._columns = Columns(
            [
                *(readers for group in self._groups for readers in group.readers()),
                [(channel, receipt_column) for channel in channels],
            ],
            [topic.device_clock() for binding in bindings for topic in binding.group.topics],
        )
        # A set whose deadline has passed leaves before a later message is fed to any group.
        self._waiting = [group.driver for group in self._groups if group.driver.has_deadlines]
        self._inputs = [
            (group.driver, index, frame_reader() if group in awaiting else None)
            for group in self._groups
            for index in range(len(group.binding.inputs))
        ]
        self._now = recording.begin

    def steps(self) -> Iterator[None]:
        """Feed the recording to its end, a batch a step."""
        for rows in self._recording.batches(self._columns.channels):
            self._feed(rows)
            self._tell()
            yield
        for group in self._groups:
            # The end of a damaged recording may be wrong.
            group.driver.finish(max(self._now, self._recording.end))
        self._tell()

    def _feed(self, rows: Sequence[RawMessage]) -> None:
        for place, raw, stamp, key in self._columns.in_order(Batch(rows)):
            self._now = now = raw[1]
            for driver in self._waiting:
                driver.expire(now)
            if place == len(self._inputs):
                self._learn(raw)
                continue
            driver, index, read_frame = self._inputs[place]
            if stamp == UNREADABLE:
                driver.reject(index, raw, now=now)
            else:
                frame = None if read_frame is None else read_frame(raw)
                driver.add(Message(index, stamp, raw, key, frame), now=now)

    def _take(self, binding: GroupBinding, outcomes: Sequence[Outcome], now: int) -> None:
        self._left.append((binding, outcomes, now))
        if len(self._left) >= _MOST_LEFT:
            self._tell()

    def _tell(self) -> None:
        left, self._left = self._left, []
        for listener in self._listeners:
            listener(left)

    def _learn(self, raw: RawMessage) -> None:
        edges = self._transforms.read(raw)
        for driver in self._awaiting:
            driver.learn(edges, now=raw[1])

    def results(self) -> list[GroupResult]:
        """Return what became of all messages so far, in the order of the groups."""
        return [group.result() for group in self._groups]


def replay(
    recording: Recording, bindings: Sequence[GroupBinding], *, listeners: Sequence[Listener] = ()
) -> list[GroupResult]:
    """Feed a recording to its end; what became of all messages, in the order of the groups.

    Raises BagError for a stamp or key that a recorded type does not have.
    """
    whole = Replay(recording, bindings, listeners=listeners)
    for _ in whole.steps():
        pass
    return whole.results()


def received(message: Message) -> int:
    """Return when a replayed message was received, in nanoseconds."""
    raw: Any = message.payload
    return int(raw[1])
