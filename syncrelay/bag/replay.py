"""A recording fed to the groups of a file as the relay would have got it, with receive time as `now`."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from syncrelay.bag.bindings import GroupBinding
from syncrelay.bag.payloads import message_reader
from syncrelay.bag.recording import Channel, RawMessage, Recording
from syncrelay.explain import EngineDriver
from syncrelay.sync import InputCounts, Message, Outcome

Listener: TypeAlias = Callable[[GroupBinding, Outcome, int], None]
"""Told of each set and drop of a group when it leaves, and at what time. The payload of a message is the RawMessage."""

_Feed: TypeAlias = Callable[[RawMessage], None]


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

    def __init__(self, binding: GroupBinding, listeners: Sequence[Listener]) -> None:
        self.binding = binding
        self.driver: Final = EngineDriver(binding.group, self._take if listeners else _take_nothing)
        self._listeners = listeners

    def feeds(self) -> Iterable[tuple[Channel, _Feed]]:
        """Give what takes in the messages of each channel; raises BagError for a stamp or key that isn't there."""
        for index, each in enumerate(self.binding.inputs):
            for channel in each.channels:
                yield channel, self._feed(index, channel)

    def result(self) -> GroupResult:
        """Give the counts so far."""
        engine = self.driver.engine
        topics = (each.config.topic for each in self.binding.inputs)
        inputs = tuple(InputResult(*each) for each in zip(topics, engine.counts(), strict=True))
        return GroupResult(self.binding.group.name, inputs, engine.sets)

    def _feed(self, index: int, channel: Channel) -> _Feed:
        read = message_reader(self.binding.group, index, channel)
        add, reject = self.driver.add, self.driver.reject

        def feed(raw: RawMessage) -> None:
            stamp, key = read(raw)
            if stamp is None:
                reject(index, raw, now=raw[1])
            else:
                add(Message(index, stamp, raw, key), now=raw[1])

        return feed

    def _take(self, outcomes: Sequence[Outcome], now: int) -> None:
        for outcome in outcomes:
            for listener in self._listeners:
                listener(self.binding, outcome, now)


def _take_nothing(_outcomes: Sequence[Outcome], _now: int) -> None:
    """Stand in for listeners where there are none."""


def replay(
    recording: Recording, bindings: Sequence[GroupBinding], *, listeners: Sequence[Listener] = ()
) -> list[GroupResult]:
    """Feed a recording to its end; what became of all messages, in the order of the groups.

    Raises BagError for a stamp or key that a recorded type does not have.
    """
    groups = [GroupReplay(binding, listeners) for binding in bindings]
    # What waited in one group leaves before a later message of another arrives.
    waiting = [group.driver for group in groups if group.driver.has_deadlines]
    feeds: dict[Channel, list[_Feed]] = {}
    for group in groups:
        for channel, feed in group.feeds():
            feeds.setdefault(channel, []).append(feed)
    now = recording.begin
    for raw in recording.messages(feeds.keys()):
        channel, now, _ = raw
        for driver in waiting:
            driver.expire(now)
        for feed in feeds[channel]:
            feed(raw)
    for group in groups:
        # A damaged recording may give a false end.
        group.driver.finish(max(now, recording.end))
    return [group.result() for group in groups]


def received(message: Message) -> int:
    """When a message that was replayed had been received, in nanoseconds."""
    raw: Any = message.payload
    return int(raw[1])
