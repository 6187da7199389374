"""equal_key: messages of equal keys are a set."""

from bisect import bisect_right
from collections.abc import Hashable, Sequence

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalKeys
from syncrelay.sync.policy import Policy, check_sizes
from syncrelay.sync.queues import Losses

_LOST_QUEUES = 10
"""Lost keys are remembered for as many messages as this many queues hold."""


class EqualKey(Policy):
    """Messages of equal `key` on all inputs are a set, and leave when the last of them is there.

    Stamps only order the messages of one input; messages of equal stamps keep the order of arrival, and stamps may be
    unset. When a set leaves, older messages of its inputs are superseded, so sets never go back. A message whose key is
    still queued on its input replaces the queued one.

        left  |ab.c.
        right |...BC
        keys: bB cC
        -> B: a superseded, bB
        -> C: cC
    """

    __slots__ = ("_fed", "_keys", "_losses", "_lost", "_messages", "_queue_size", "_stamps", "n_inputs")

    by_stamp = False

    def __init__(self, *, n_inputs: int, queue_size: int) -> None:
        check_sizes(n_inputs, queue_size)
        self.n_inputs = n_inputs
        self._queue_size = queue_size
        self._fed = [0] * n_inputs
        self._losses = Losses(n_inputs)
        self._reset()

    def for_required(self, required: Sequence[bool], quorum: int) -> tuple["EqualKey", OptionalKeys]:
        if not any(required):
            raise ValueError(f"required {required} must be one or more: whose keys make the sets")
        stage = OptionalKeys(required=required, quorum=quorum, queue_size=self._queue_size)
        return EqualKey(n_inputs=sum(required), queue_size=self._queue_size), stage

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        key = message.key
        outcomes: list[Outcome] = []
        if key in self._messages[place]:
            replaced = self._take(place, self._keys[place].index(key))
            outcomes.append(Drop(replaced, DropReason.DUPLICATE))
        self._put(place, stamp, message)
        if all(key in messages for messages in self._messages):
            self._leave(key, outcomes)
        elif len(self._keys[place]) > self._queue_size:
            outcomes.append(self._overflow(place))
        return outcomes

    def flush(self, reason: DropReason) -> list[Drop]:
        drops = [
            Drop(messages[key], reason)
            for messages, keys in zip(self._messages, self._keys, strict=True)
            for key in keys
        ]
        self._reset()
        return drops

    def buffered(self, place: int) -> int:
        return len(self._keys[place])

    def needed_queue(self, place: int) -> int | None:
        return self._losses.needed[place]

    def _reset(self) -> None:
        places = range(self.n_inputs)
        self._messages: list[dict[Hashable, Message]] = [{} for _ in places]
        self._keys: list[list[Hashable]] = [[] for _ in places]
        self._stamps: list[list[int]] = [[] for _ in places]
        self._lost: list[dict[Hashable, int]] = [{} for _ in places]

    def _put(self, place: int, stamp: int, message: Message) -> None:
        key = message.key
        self._messages[place][key] = message
        position = bisect_right(self._stamps[place], stamp)
        self._stamps[place].insert(position, stamp)
        self._keys[place].insert(position, key)
        self._fed[place] += 1
        for other, lost in enumerate(self._lost):
            if other != place and key in lost:
                self._losses.need(other, self._fed[other] - lost[key] + 1)

    def _take(self, place: int, position: int) -> Message:
        del self._stamps[place][position]
        return self._messages[place].pop(self._keys[place].pop(position))

    def _overflow(self, place: int) -> Drop:
        dropped = self._take(place, 0)
        lost = self._lost[place]
        lost[dropped.key] = self._fed[place] - self._queue_size
        if len(lost) > _LOST_QUEUES * self._queue_size:
            del lost[next(iter(lost))]
        return Drop(dropped, DropReason.OVERFLOW)

    def _leave(self, key: Hashable, outcomes: list[Outcome]) -> None:
        members = []
        for place, keys in enumerate(self._keys):
            older = [self._take(place, 0) for _ in range(keys.index(key))]
            outcomes += [Drop(message, DropReason.SUPERSEDED) for message in older]
            members.append(self._take(place, 0))
        outcomes.append(Match(tuple(members)))
