"""Stand-ins for a group's engine while no sets may leave: it failed, it is suspended, or the group is paused."""

from collections import deque
from collections.abc import Collection, Sequence

from syncrelay.sync import Drop, DropReason, Lapse, Match, Message, SyncGroup
from syncrelay.sync.counts import InputCounts


class StoppedEngine:
    """Stands in for an engine that failed or is suspended: it gives no sets, and its counts stay as they were.

    It holds the newest `most` messages; one that is to be rejected is held with the reason.
    """

    def __init__(self, sets: int, counts: tuple[InputCounts, ...], *, most: int = 0) -> None:
        self.sets = sets
        self.lapses: tuple[Lapse, ...] = ()
        self.held: deque[tuple[Message, DropReason | None]] = deque(maxlen=most)
        self._counts = counts

    def add(self, message: Message, *, now: int) -> Sequence[Match | Drop]:  # noqa: ARG002  an engine's signature
        self.held.append((message, None))
        return ()

    def reject(self, message: Message, reason: DropReason) -> Drop:
        self.held.append((message, reason))
        return Drop(message, reason)

    def expire(self, *, now: int) -> Sequence[Match | Drop]:  # noqa: ARG002
        return ()

    def flush(self, reason: DropReason) -> Sequence[Drop]:  # noqa: ARG002
        return ()

    def let_go(self, reason: DropReason) -> Sequence[Drop]:  # noqa: ARG002
        return ()

    def next_deadline(self) -> int | None:
        return None

    def counts(self) -> tuple[InputCounts, ...]:
        return self._counts


class PausedEngine:
    """Stands in for the engine of a paused group: messages that wait in it, and new ones, are dropped as `paused`.

    An input that is `held` keeps its latest message, which may be in many sets: a map, say, may be sent only once, and
    the first set after the pause needs it.
    """

    def __init__(self, engine: SyncGroup, *, held: Collection[int]) -> None:
        self.engine = engine
        self._held = held

    @property
    def sets(self) -> int:
        return self.engine.sets

    @property
    def lapses(self) -> Sequence[Lapse]:
        return self.engine.lapses

    def add(self, message: Message, *, now: int) -> Sequence[Match | Drop]:
        if message.input not in self._held:
            return (self.engine.reject(message, DropReason.PAUSED),)
        # This makes no set: neither a trigger nor a tick of a clock comes.
        self.engine.pass_over(now=now)
        return [*self.engine.add(message, now=now), *self.engine.let_go(DropReason.PAUSED)]

    def reject(self, message: Message, reason: DropReason) -> Drop:
        return self.engine.reject(message, reason)

    def expire(self, *, now: int) -> Sequence[Match | Drop]:  # noqa: ARG002  an engine's signature
        return ()

    def flush(self, reason: DropReason) -> Sequence[Drop]:
        return self.engine.flush(reason)

    def let_go(self, reason: DropReason) -> Sequence[Drop]:
        return self.engine.let_go(reason)

    def next_deadline(self) -> int | None:
        return None

    def counts(self) -> tuple[InputCounts, ...]:
        return self.engine.counts()
