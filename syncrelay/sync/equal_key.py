"""equal_key: messages of equal keys are a set."""

from bisect import bisect_right
from collections.abc import Hashable, Sequence

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Policy, check_sizes

_LOST_QUEUES = 10
"""How many queues' worth of lost keys are remembered, to tell how long a queue was needed."""


class EqualKey(Policy):
    """Messages of equal `key` on all inputs are a set, and leave when the last of them is there.

    Stamps only put the messages of one input in order, those of one stamp by arrival; they may be unset. When a
    set leaves, what is older on the inputs it came from is superseded, so sets never go back. A message of a
    key that its input still has queued replaces that one. A set of all `required` inputs waits for the
    optional ones until `settle`, or until a later set is full.
    """

    __slots__ = (
        "_fed",
        "_keys",
        "_lost",
        "_messages",
        "_needed",
        "_open",
        "_queue_size",
        "_required",
        "_stamps",
        "closed",
        "n_inputs",
        "opened",
    )

    by_stamp = False

    def __init__(self, *, n_inputs: int, queue_size: int, required: Sequence[bool] | None = None) -> None:
        check_sizes(n_inputs, queue_size)
        needed = (True,) * n_inputs if required is None else tuple(required)
        if len(needed) != n_inputs or True not in needed:
            raise ValueError(f"required {needed} must be one a input, of {n_inputs}, one of them True")
        self.n_inputs = n_inputs
        self._queue_size = queue_size
        self._required = [place for place, is_needed in enumerate(needed) if is_needed]
        self._fed = [0] * n_inputs
        self._needed: list[int | None] = [None] * n_inputs
        self.opened = 0
        self._reset()

    def narrowed(self, required: Sequence[bool]) -> tuple["EqualKey", OptionalInputs]:
        policy = EqualKey(n_inputs=self.n_inputs, queue_size=self._queue_size, required=required)
        return policy, OptionalInputs(required=(True,) * self.n_inputs, queue_size=1, slop_ns=0)

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        key = message.key
        outcomes: list[Outcome] = []
        if key in self._messages[place]:
            replaced = self._take(place, self._keys[place].index(key))
            outcomes.append(Drop(replaced, DropReason.DUPLICATE))
        self._put(place, stamp, message)
        if all(key in messages for messages in self._messages):
            self._leave_up_to(key, outcomes)
        elif key not in self._open and all(key in self._messages[other] for other in self._required):
            self._open[key] = None
            self.opened += 1
        if len(self._keys[place]) > self._queue_size:
            self._overflow(place, outcomes)
        return outcomes

    def settle(self) -> Sequence[Outcome]:
        outcomes: list[Outcome] = []
        self._leave(next(iter(self._open)), outcomes)
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
        return self._needed[place]

    def _reset(self) -> None:
        places = range(self.n_inputs)
        self._messages: list[dict[Hashable, Message]] = [{} for _ in places]
        self._keys: list[list[Hashable]] = [[] for _ in places]
        self._stamps: list[list[int]] = [[] for _ in places]
        self._lost: list[dict[Hashable, int]] = [{} for _ in places]
        self._open: dict[Hashable, None] = {}
        self.closed = self.opened

    def _put(self, place: int, stamp: int, message: Message) -> None:
        key = message.key
        self._messages[place][key] = message
        position = bisect_right(self._stamps[place], stamp)
        self._stamps[place].insert(position, stamp)
        self._keys[place].insert(position, key)
        self._fed[place] += 1
        for other, lost in enumerate(self._lost):
            if key in lost and other != place:
                self._needed[other] = self._fed[other] - lost[key] + 1

    def _take(self, place: int, position: int) -> Message:
        del self._stamps[place][position]
        return self._messages[place].pop(self._keys[place].pop(position))

    def _overflow(self, place: int, outcomes: list[Outcome]) -> None:
        key = self._keys[place][0]
        if key in self._open:
            self._leave_up_to(key, outcomes)
            return
        lost = self._lost[place]
        lost[key] = self._fed[place] - self._queue_size
        if len(lost) > _LOST_QUEUES * self._queue_size:
            del lost[next(iter(lost))]
        outcomes.append(Drop(self._take(place, 0), DropReason.OVERFLOW))

    def _leave_up_to(self, key: Hashable, outcomes: list[Outcome]) -> None:
        """Let a set leave, and before it the older ones that wait."""
        order = self._keys[self._required[0]]
        for older in order[: order.index(key)]:
            if older in self._open:
                self._leave(older, outcomes)
        self._leave(key, outcomes)

    def _leave(self, key: Hashable, outcomes: list[Outcome]) -> None:
        members: list[Message | None] = [None] * self.n_inputs
        for place, keys in enumerate(self._keys):
            if key in self._messages[place]:
                self._drop_older(place, keys.index(key), outcomes)
                members[place] = self._take(place, 0)
        self._close(key)
        outcomes.append(Match(tuple(members)))

    def _drop_older(self, place: int, count: int, outcomes: list[Outcome]) -> None:
        for _ in range(count):
            message = self._take(place, 0)
            outcomes.append(Drop(message, DropReason.SUPERSEDED))
            if place in self._required:
                self._close(message.key)

    def _close(self, key: Hashable) -> None:
        if key in self._open:
            del self._open[key]
            self.closed += 1
