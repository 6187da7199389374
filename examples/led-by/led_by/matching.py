"""The matching: it knows stamps and the order of arrival, and no clock."""

from collections.abc import Sequence

from syncrelay.sync import Drop, DropReason, Match, Message, OptionalInputs, Outcome, Policy, StampQueue


class LedBy(Policy):
    """At each message of the lead, the nearest of every other input, if all lie within reach."""

    def __init__(self, *, n_inputs: int, queue_size: int, lead: int, reach_ns: int) -> None:
        self.n_inputs = n_inputs
        self._size, self._lead, self._reach = queue_size, lead, reach_ns
        self._queues = [StampQueue() for _ in range(n_inputs)]

    def for_required(self, required: Sequence[bool], quorum: int) -> tuple[Policy, OptionalInputs]:
        lead = sum(required[: self._lead])
        policy = LedBy(n_inputs=sum(required), queue_size=self._size, lead=lead, reach_ns=self._reach)
        return policy, OptionalInputs(required=required, quorum=quorum, queue_size=self._size, slop_ns=self._reach)

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        queue, led = self._queues[place], self._queues[self._lead].stamps
        replaced = queue.insert(stamp, message)
        outcomes: list[Outcome] = [] if replaced is None else [Drop(replaced, DropReason.DUPLICATE)]
        # What is nearest is known once each input has come up to the lead's message.
        while led and all(each.stamps and each.stamps[-1] >= led[0] for each in self._queues):
            outcomes += self._decide(led[0])
        if len(queue.stamps) > self._size:
            outcomes += [Drop(oldest, DropReason.OVERFLOW) for oldest in queue.take(1)]
        return outcomes

    def _decide(self, lead: int) -> list[Outcome]:
        nearest = [min(range(len(each.stamps)), key=lambda n: abs(each.stamps[n] - lead)) for each in self._queues]
        stamps = [each.stamps[n] for each, n in zip(self._queues, nearest, strict=True)]
        if max(stamps) - min(stamps) > self._reach:
            return [Drop(far, DropReason.TOO_FAR) for far in self._queues[self._lead].take(1)]
        older = [each.take(n) for each, n in zip(self._queues, nearest, strict=True)]
        match = Match(tuple(each.take(1)[0] for each in self._queues))
        return [*(Drop(message, DropReason.SUPERSEDED) for messages in older for message in messages), match]

    def flush(self, reason: DropReason) -> list[Drop]:
        return [Drop(message, reason) for each in self._queues for message in each.take(len(each.stamps))]

    def buffered(self, place: int) -> int:
        return len(self._queues[place].stamps)

    def needed_queue(self, place: int) -> int | None:  # noqa: ARG002  the protocol's signature
        return None
