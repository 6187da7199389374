"""One stretch of a recording, replayed: from a state like that of one pass, or on from where the one before ended."""

import pickle
from bisect import bisect_left
from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from hashlib import blake2b
from io import BytesIO
from operator import itemgetter
from typing import Any, Final

from syncrelay.errors import BagError
from syncrelay.recordings.bag.bindings import GroupBinding
from syncrelay.recordings.bag.recording import Channel, RawMessage, Recording, is_part
from syncrelay.recordings.bag.replay import GroupResult, InputResult, Listener, Replay
from syncrelay.recordings.bag.stretches import GroupStretch, Stretch, StretchResult
from syncrelay.sync import InputCounts, Outcome, SyncGroup

_RECEIVED: Final = itemgetter(1)


class StretchReplay:
    """Groups at work on a stretch, a step for each batch that is read of it."""

    def __init__(
        self,
        recording: Recording,
        bindings: Sequence[GroupBinding],
        stretch: Stretch,
        *,
        listeners: Sequence[Listener] = (),
        after: StretchResult | None = None,
    ) -> None:
        """Go on where the stretch before ended, `after` that, or lead in; listeners are told only of what leaves in it.

        Raises BagError for a stamp or key that a recorded type does not have.
        """
        if stretch.begin > recording.end:
            # What waits at the end would leave before it, and what is left then at another time.
            raise ValueError(f"{stretch} begins after the recording's end, {recording.end}")
        self._recording = recording
        self._bindings = bindings
        self._stretch = stretch
        self._listeners = listeners
        self._channels = {channel: place for place, channel in enumerate(recording.channels)}
        self._read_from = stretch.read_from if after is None else stretch.begin
        self._opening_end = min(stretch.opening_end, stretch.read_from) if after is None else 0
        engines = None if after is None else [self._thawed(each.engine) for each in after.groups]
        self._is_within = False
        self._replay = Replay(recording, bindings, listeners=[self._take] if listeners else (), engines=engines)
        self._entry: list[Hashable] = []
        self._before: list[GroupResult] = []

    def steps(self) -> Iterator[None]:
        """Feed the stretch to its end, a batch a step.

        Raises BagError where messages do not come in the order of receipt, so that no time parts them.
        """
        stretch = self._stretch
        if self._opening_end:
            yield from self._feed(self._batches(0, self._opening_end))
        rows = _Rows(self._batches(self._read_from, stretch.end))
        yield from self._feed(rows.until(stretch.begin))
        # What was due before the stretch left before it.
        self._replay.expire(stretch.begin - 1)
        self._entry = self._states()
        self._before = self._replay.results()
        self._is_within = True
        yield from self._feed(rows.until(stretch.end))
        if stretch.is_last:
            self._replay.finish()
        else:
            self._replay.expire(stretch.end - 1)

    def result(self) -> StretchResult:
        """Give what the groups made of the stretch, once all steps are taken."""
        counts = [_since(*each) for each in zip(self._replay.results(), self._before, strict=True)]
        engines = [b"" if self._stretch.is_last else self._frozen(each) for each in self._replay.engines]
        groups = map(GroupStretch, self._entry, self._states(), counts, engines)
        return StretchResult(self._stretch, tuple(groups))

    def _batches(self, begin: int, end: int) -> Iterator[list[RawMessage]]:
        batches = self._recording.batches(self._replay.channels, begin=begin, end=end)
        return _in_order(batches) if is_part(begin, end) else batches

    def _feed(self, batches: Iterable[Sequence[RawMessage]]) -> Iterator[None]:
        for rows in batches:
            self._replay.feed(rows)
            yield

    def _take(self, binding: GroupBinding, outcome: Outcome, now: int) -> None:
        if self._is_within:
            for listener in self._listeners:
                listener(binding, outcome, now)

    def _states(self) -> list[Hashable]:
        return [engine.state(self._name) for engine in self._replay.engines]

    def _name(self, raw: RawMessage) -> Hashable:
        """Tell a message from all others: those that are alike in all of this may stand for each other in any set."""
        channel, received, payload = raw
        return self._channels[channel], received, blake2b(payload, digest_size=16).digest()

    def _frozen(self, engine: SyncGroup) -> bytes:
        frozen = BytesIO()
        _Pickler(frozen, self._channels).dump(engine)
        return frozen.getvalue()

    def _thawed(self, frozen: bytes) -> SyncGroup:
        engine: SyncGroup = _Unpickler(BytesIO(frozen), self._recording.channels).load()
        return engine


def run_stretch(
    recording: Recording,
    bindings: Sequence[GroupBinding],
    stretch: Stretch,
    *,
    listeners: Sequence[Listener] = (),
    after: StretchResult | None = None,
) -> StretchResult:
    """Replay a stretch to its end; see StretchReplay, of which it raises the errors."""
    replay = StretchReplay(recording, bindings, stretch, listeners=listeners, after=after)
    for _ in replay.steps():
        pass
    return replay.result()


class _Rows:
    """The messages of a recording, first up to one time, then up to another."""

    def __init__(self, batches: Iterable[list[RawMessage]]) -> None:
        self._batches = iter(batches)
        self._held: list[RawMessage] = []

    def until(self, time: int) -> Iterator[list[RawMessage]]:
        """Yield what was received before a time."""
        while True:
            due = bisect_left(self._held, time, key=_RECEIVED)
            rows, self._held = self._held[:due], self._held[due:]
            yield rows
            if self._held:
                return
            following = next(self._batches, None)
            if following is None:
                return
            self._held = following


def _in_order(batches: Iterable[list[RawMessage]]) -> Iterator[list[RawMessage]]:
    latest = 0
    for rows in batches:
        for channel, received, _ in rows:
            if received < latest:
                raise BagError(
                    f"a message of {channel.topic} that was received at {received} comes behind one received at"
                    f" {latest}, expected the order of receipt: read the recording as a whole, not in stretches"
                )
            latest = received
        yield rows


class _Pickler(pickle.Pickler):
    """Writes the place of a channel in the recording for the channel."""

    def __init__(self, file: BytesIO, places: Mapping[Channel, int]) -> None:
        super().__init__(file, protocol=pickle.HIGHEST_PROTOCOL)
        self._places = places

    def persistent_id(self, value: Any) -> int | None:
        return self._places[value] if isinstance(value, Channel) else None


class _Unpickler(pickle.Unpickler):
    """Reads what was written for another reader of the same recording."""

    def __init__(self, file: BytesIO, channels: Sequence[Channel]) -> None:
        super().__init__(file)
        self._channels = channels

    def persistent_load(self, place: int) -> Channel:
        return self._channels[place]


def _since(now: GroupResult, before: GroupResult) -> GroupResult:
    """Return the counts of a group between two moments."""
    inputs = [
        InputResult(each.topic, _difference(each.counts, old.counts))
        for each, old in zip(now.inputs, before.inputs, strict=True)
    ]
    return GroupResult(now.name, tuple(inputs), now.sets - before.sets)


def _difference(now: InputCounts, before: InputCounts) -> InputCounts:
    dropped = Counter(now.dropped)
    dropped.subtract(before.dropped)
    return InputCounts(
        now.fed - before.fed,
        now.matched - before.matched,
        {reason: count for reason, count in dropped.items() if count},
        now.buffered,
        now.needed_queue,
    )
