"""A recording fed to the groups of a file as the relay would have got it, with receive time as `now`."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from syncrelay.bag.definitions import begins_with_header
from syncrelay.bag.payloads import stamp_reader, value_reader
from syncrelay.bag.recording import LATEST, Channel, Encoding, RawMessage, Recording
from syncrelay.bag.wiring import Wiring
from syncrelay.cdr import LATEST_STAMP, has_place_for_stamp
from syncrelay.sync import DropReason, InputCounts, Message, Outcome, SyncGroup

Listener: TypeAlias = Callable[[Wiring, Outcome, int], None]
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

    def __init__(self, wiring: Wiring, listeners: Sequence[Listener]) -> None:
        self.wiring = wiring
        self.engine: Final[SyncGroup] = wiring.group.engine()
        self._listeners = listeners

    def feeds(self) -> Iterable[tuple[Channel, _Feed]]:
        """Give what takes in the messages of each channel; raises BagError for a stamp or key that isn't there."""
        for index, each in enumerate(self.wiring.inputs):
            for channel in each.channels:
                yield channel, self._feed(index, channel)

    def let_go(self, now: int) -> None:
        """Let what has waited long enough leave, each at its own time, up to `now`."""
        while (deadline := self.engine.next_deadline()) is not None and deadline <= now:
            self._settle(self.engine.expire(now=deadline), deadline)

    def finish(self, now: int) -> None:
        """Let all leave that may: what still waits has a deadline or never will have a partner."""
        while (deadline := self.engine.next_deadline()) is not None:
            now = max(now, deadline)
            self._settle(self.engine.expire(now=now), now)
        self._settle(self.engine.flush(DropReason.SHUTDOWN), now)

    def result(self) -> GroupResult:
        """Give the counts so far."""
        topics = (each.config.topic for each in self.wiring.inputs)
        inputs = tuple(InputResult(*each) for each in zip(topics, self.engine.counts(), strict=True))
        return GroupResult(self.wiring.group.name, inputs, self.engine.sets)

    def _feed(self, index: int, channel: Channel) -> _Feed:
        feed = self._feed_any(index, channel)
        by = self.wiring.inputs[index].config.stamp
        # Reading a header's stamp shows that there is a place for one, and that a header can hold it.
        if self.wiring.group.restamp is None or by == "header":
            return feed
        latest = LATEST_STAMP if by == "receive" else LATEST
        needs_place = self._has_header(channel)

        def feed_if_it_can_be_restamped(raw: RawMessage) -> None:
            if raw[1] <= latest and (not needs_place or has_place_for_stamp(raw[2])):
                feed(raw)
            else:
                self._reject(index, raw)

        return feed_if_it_can_be_restamped

    def _has_header(self, channel: Channel) -> bool:
        return channel.encoding is not Encoding.ROS1 and bool(begins_with_header(channel))

    def _feed_any(self, index: int, channel: Channel) -> _Feed:
        topic = self.wiring.inputs[index].config
        read_stamp = stamp_reader(topic.stamp, channel)
        read_key = None if topic.key is None else value_reader(channel, topic.key)
        add, settle, reject = self.engine.add, self._settle, self._reject
        listeners = self._listeners

        def feed(raw: RawMessage) -> None:
            _, received, payload = raw
            stamp = received if read_stamp is None else read_stamp(payload)
            if stamp is None:
                reject(index, raw)
                return
            outcomes = add(Message(index, stamp, raw), now=received)
            if outcomes and listeners:
                settle(outcomes, received)

        def feed_keyed(raw: RawMessage) -> None:
            _, received, payload = raw
            stamp = received if read_stamp is None else read_stamp(payload)
            key: Hashable = read_key(payload) if read_key else None
            if stamp is None or key is None:
                reject(index, raw)
                return
            settle(add(Message(index, stamp, raw, key), now=received), received)

        return feed if read_key is None else feed_keyed

    def _reject(self, index: int, raw: RawMessage) -> None:
        self._settle([self.engine.reject(Message(index, 0, raw), DropReason.MALFORMED)], raw[1])

    def _settle(self, outcomes: Sequence[Outcome], now: int) -> None:
        for outcome in outcomes:
            for listener in self._listeners:
                listener(self.wiring, outcome, now)


def replay(recording: Recording, wirings: Sequence[Wiring], *, listeners: Sequence[Listener] = ()) -> list[GroupResult]:
    """Feed a recording to its end; what became of all messages, in the order of the groups.

    Raises BagError for a stamp or key that a recorded type does not have.
    """
    groups = [GroupReplay(wiring, listeners) for wiring in wirings]
    limited = [group for group in groups if group.wiring.group.options.max_wait is not None]
    feeds: dict[Channel, list[_Feed]] = {}
    for group in groups:
        for channel, feed in group.feeds():
            feeds.setdefault(channel, []).append(feed)
    now = recording.begin
    for raw in recording.messages(feeds.keys()):
        channel, now, _ = raw
        for group in limited:
            group.let_go(now)
        for feed in feeds[channel]:
            feed(raw)
    for group in groups:
        # What tells the end of a damaged recording may lie.
        group.finish(max(now, recording.end))
    return [group.result() for group in groups]


def received(message: Message) -> int:
    """When a message that was replayed had been received, in nanoseconds."""
    raw: Any = message.payload
    return int(raw[1])
