"""A group: what all policies share."""

from collections import defaultdict
from collections.abc import Sequence

from syncrelay.sync.counts import InputCounts
from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.policy import Policy
from syncrelay.sync.restamp import Restamp, common_stamp

JUMP_NS = 1_000_000_000
"""A stamp that falls by more than this on one input is a looped recording or a reset clock, not lateness."""

_NEVER = -(1 << 63)


class SyncGroup:
    """Runs one policy: feeds it what may be used, counts where every message went.

    Messages go in and come out with the stamps they carry; an input's offset counts for matching only.
    Older than what its input last gave to a set, or as old: `late`. A stamp more than JUMP_NS below its
    input's newest flushes the group, which then knows nothing of the time before.
    """

    __slots__ = (
        "_dropped",
        "_fed",
        "_given",
        "_matched",
        "_newest",
        "_offsets",
        "_policy",
        "_restamp",
        "sets",
    )

    def __init__(
        self,
        policy: Policy,
        *,
        required: Sequence[bool],
        max_wait_ns: int | None = None,
        offsets_ns: Sequence[int] | None = None,
        restamp: Restamp | int | None = None,
    ) -> None:
        n_inputs = policy.n_inputs
        offsets = [0] * n_inputs if offsets_ns is None else list(offsets_ns)
        if len(required) != n_inputs or len(offsets) != n_inputs:
            raise ValueError(f"required and offsets_ns must be one a input, of {n_inputs}")
        if not all(required) or max_wait_ns is not None:
            raise NotImplementedError("optional inputs and max_wait come with issue 3")
        self._policy = policy
        self._offsets = offsets
        self._restamp = restamp
        self._fed = [0] * n_inputs
        self._matched = [0] * n_inputs
        self._dropped: list[dict[DropReason, int]] = [defaultdict(int) for _ in offsets]
        self.sets = 0
        self._forget()

    def add(self, message: Message, *, now: int) -> Sequence[Outcome]:
        """Take a message that arrives at `now`; give what leaves because of it, in order."""
        del now
        place = message.input
        stamp = message.stamp
        self._fed[place] += 1
        if stamp <= self._newest[place]:
            return self._add_behind(message)
        self._newest[place] = stamp
        outcomes = self._policy.feed(place, stamp + self._offsets[place], message)
        return self._leave(outcomes) if outcomes else outcomes

    def reject(self, message: Message, reason: DropReason) -> Drop:
        """Count a message that cannot be fed: it has no readable stamp."""
        self._fed[message.input] += 1
        return self._drop(message, reason)

    def next_deadline(self) -> int | None:
        """When `expire` has something to do, in the time of `now`; None: not before the next message."""
        return None

    def expire(self, *, now: int) -> Sequence[Outcome]:
        """Give what leaves because it has waited long enough."""
        del now
        return ()

    def flush(self, reason: DropReason) -> Sequence[Drop]:
        """Drop all that is buffered and start afresh. The counts go on."""
        drops = self._policy.flush(reason)
        self._forget()
        self._leave(drops)
        return drops

    def counts(self) -> tuple[InputCounts, ...]:
        """Where the messages of each input went since the group was made."""
        return tuple(
            InputCounts(fed, matched, dict(dropped), self._policy.buffered(place))
            for place, (fed, matched, dropped) in enumerate(
                zip(self._fed, self._matched, self._dropped, strict=True)
            )
        )

    def _forget(self) -> None:
        self._newest = [0] * self._policy.n_inputs
        self._given = [_NEVER] * self._policy.n_inputs

    def _add_behind(self, message: Message) -> Sequence[Outcome]:
        """Take a message that is not newer than all before: unset, late, out of order or from a new time."""
        place = message.input
        stamp = message.stamp
        drops: Sequence[Outcome] = ()
        if stamp == 0:
            return (self._drop(message, DropReason.UNSTAMPED),)
        if stamp < self._newest[place] - JUMP_NS:
            drops = self.flush(DropReason.TIME_JUMP)
        if stamp <= self._given[place]:
            return (self._drop(message, DropReason.LATE),)
        self._newest[place] = max(stamp, self._newest[place])
        outcomes = self._policy.feed(place, stamp + self._offsets[place], message)
        return [*drops, *self._leave(outcomes)]

    def _drop(self, message: Message, reason: DropReason) -> Drop:
        self._dropped[message.input][reason] += 1
        return Drop(message, reason)

    def _leave(self, outcomes: Sequence[Outcome]) -> Sequence[Outcome]:
        """Count what leaves, and give sets their common stamp."""
        for outcome in outcomes:
            if isinstance(outcome, Drop):
                self._dropped[outcome.message.input][outcome.reason] += 1
                continue
            self.sets += 1
            for message in outcome.messages:
                if message is not None:
                    self._matched[message.input] += 1
                    self._given[message.input] = message.stamp
        if self._restamp is None:
            return outcomes
        return [self._restamped(outcome) for outcome in outcomes]

    def _restamped(self, outcome: Outcome) -> Outcome:
        if isinstance(outcome, Drop) or self._restamp is None:
            return outcome
        return Match(outcome.messages, common_stamp(outcome.messages, self._restamp))
