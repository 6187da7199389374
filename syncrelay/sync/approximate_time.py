"""approximate_time: the best match, as C++ message_filters' ApproximateTime finds it."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Policy, check_sizes, of_required
from syncrelay.sync.queues import Losses

_NO_PIVOT = -1


class ApproximateTime(Policy):
    """The set of least span around each pivot leaves as soon as no later message could better it.

    On messages that arrive in stamp order these are the sets of C++ message_filters' ApproximateTime at the
    same moments, `slop_ns` being its max interval (inclusive), `min_periods_ns` its lower bounds between
    messages. Beyond it: queues are in stamp order, so that what arrives out of order is used; a message of
    a stamp that is still queued replaces that one; each message that leaves unmatched is told.

    Terms as there: heads are the oldest messages not yet passed; the pivot is the input whose head was the
    latest when a first candidate was found; the candidate is the best set of this pivot so far, always the
    front of the queues; what lies between it and the heads is skipped, and comes back when it leaves.
    """

    __slots__ = (
        "_age_penalty",
        "_candidate_end",
        "_candidate_start",
        "_cursors",
        "_empty",
        "_heads",
        "_losses",
        "_messages",
        "_min_periods",
        "_overflowed",
        "_pivot",
        "_pivot_stamp",
        "_proof_end",
        "_queue_size",
        "_scale",
        "_slop",
        "_stamps",
        "closed",
        "n_inputs",
        "opened",
    )

    def __init__(
        self,
        *,
        n_inputs: int,
        queue_size: int,
        slop_ns: int,
        age_penalty: float = 0.1,
        min_periods_ns: Sequence[int] | None = None,
    ) -> None:
        periods = (0,) * n_inputs if min_periods_ns is None else tuple(min_periods_ns)
        check_sizes(n_inputs, queue_size)
        if slop_ns < 0 or not 0 <= age_penalty < float("inf"):
            raise ValueError(f"slop_ns {slop_ns} and age_penalty {age_penalty} must be 0 or more")
        if len(periods) != n_inputs or min(periods) < 0:
            raise ValueError(f"min_periods_ns {periods} must be {n_inputs} numbers, 0 or more")
        self.n_inputs = n_inputs
        self._queue_size = queue_size
        self._slop = slop_ns
        self._age_penalty = age_penalty
        self._scale = (1.0 + age_penalty).as_integer_ratio()
        self._min_periods = periods
        self._stamps: list[list[int]] = [[] for _ in periods]
        self._messages: list[list[Message]] = [[] for _ in periods]
        self._losses = Losses(n_inputs)
        self.opened = 0
        self._reset()

    def narrowed(self, required: Sequence[bool]) -> tuple["ApproximateTime", OptionalInputs]:
        policy = ApproximateTime(
            n_inputs=sum(required),
            queue_size=self._queue_size,
            slop_ns=self._slop,
            age_penalty=self._age_penalty,
            min_periods_ns=of_required(self._min_periods, required),
        )
        stage = OptionalInputs(
            required=required,
            queue_size=self._queue_size,
            slop_ns=self._slop,
            min_periods_ns=self._min_periods,
        )
        return policy, stage

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        stamps = self._stamps[place]
        if stamps and stamp <= stamps[-1]:
            return self._feed_behind(place, stamp, message)
        outcomes: Sequence[Outcome] = ()
        was_empty = self._cursors[place] == len(stamps)
        stamps.append(stamp)
        self._messages[place].append(message)
        if was_empty:
            self._heads[place] = stamp
            self._empty -= 1
            if not self._empty:
                outcomes = self._search([])
        if len(stamps) > self._queue_size:
            return self._overflow(place, list(outcomes))
        return outcomes

    def settle(self) -> Sequence[Outcome]:
        outcomes: list[Outcome] = []
        self._emit(outcomes)
        return self._search(outcomes)

    def flush(self, reason: DropReason) -> list[Drop]:
        drops = [Drop(message, reason) for messages in self._messages for message in messages]
        for stamps, messages in zip(self._stamps, self._messages, strict=True):
            stamps.clear()
            messages.clear()
        self._reset()
        return drops

    def buffered(self, place: int) -> int:
        return len(self._messages[place])

    def needed_queue(self, place: int) -> int | None:
        return self._losses.needed[place]

    def _reset(self) -> None:
        self.closed = self.opened
        self._losses.forget()
        self._overflowed = [False] * self.n_inputs
        self._heads = [0] * self.n_inputs
        self._cursors = [0] * self.n_inputs
        self._forget_candidate()

    def _forget_candidate(self) -> None:
        """Bring back what the candidate skipped, and its members unless they were taken out before."""
        self._pivot = _NO_PIVOT
        self._empty = 0
        for place, stamps in enumerate(self._stamps):
            self._cursors[place] = 0
            if stamps:
                self._heads[place] = stamps[0]
            else:
                self._empty += 1

    def _feed_behind(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        stamps = self._stamps[place]
        messages = self._messages[place]
        position = bisect_left(stamps, stamp)
        if stamps[position] == stamp:
            replaced = messages[position]
            messages[position] = message
            return (Drop(replaced, DropReason.DUPLICATE),)
        passed = position <= self._cursors[place]
        stamps.insert(position, stamp)
        messages.insert(position, message)
        outcomes: list[Outcome] = []
        if passed:
            self._forget_candidate()
            self._search(outcomes)
        if len(stamps) > self._queue_size:
            self._overflow(place, outcomes)
        return outcomes

    def _overflow(self, place: int, outcomes: list[Outcome]) -> list[Outcome]:
        outcomes.append(Drop(self._messages[place].pop(0), DropReason.OVERFLOW))
        self._losses.lose(place, self._stamps[place].pop(0))
        self._overflowed[place] = True
        had_candidate = self._pivot != _NO_PIVOT
        self._forget_candidate()
        return self._search(outcomes) if had_candidate else outcomes

    def _search(self, outcomes: list[Outcome]) -> list[Outcome]:
        heads = self._heads
        cursors = self._cursors
        numerator, denominator = self._scale
        while not self._empty:
            start = min(heads)
            end = max(heads)
            latest = self._latest_head(end)
            first = heads.index(start)
            if self._pivot == _NO_PIVOT:
                if end - start > self._slop or self._overflowed[latest]:
                    self._note_missed(start)
                    self._drop_head(first, outcomes)
                    continue
                self._pivot = latest
                self._pivot_stamp = end
                self._take_candidate(start, end)
            elif (end - self._candidate_end) * numerator < (start - self._candidate_start) * denominator:
                self._drop_skipped(outcomes)
                self._take_candidate(start, end)
            cursor = cursors[first] + 1
            cursors[first] = cursor
            stamps = self._stamps[first]
            if cursor == len(stamps):
                self._empty = 1
            else:
                heads[first] = stamps[cursor]
            if first == self._pivot or end >= self._proof_end or (self._empty and self._is_proved()):
                self._emit(outcomes)
        if self._pivot == _NO_PIVOT:
            self.closed = self.opened
        elif self.closed == self.opened:
            self.opened += 1
        return outcomes

    def _latest_head(self, end: int) -> int:
        """Give the last input whose head is the latest; the others have not lost what could be their best."""
        latest = self.n_inputs - 1 - self._heads[::-1].index(end)
        if True in self._overflowed:
            self._overflowed = [lost and place == latest for place, lost in enumerate(self._overflowed)]
        return latest

    def _note_missed(self, start: int) -> None:
        """See whether what would have matched the earliest head had overflowed."""
        for place, head in enumerate(self._heads):
            if head > start:
                self._losses.miss(place, self._stamps[place], start, self._slop)

    def _drop_head(self, place: int, outcomes: list[Outcome]) -> None:
        stamps = self._stamps[place]
        outcomes.append(Drop(self._messages[place].pop(0), DropReason.TOO_FAR))
        del stamps[0]
        if stamps:
            self._heads[place] = stamps[0]
        else:
            self._empty = 1

    def _take_candidate(self, start: int, end: int) -> None:
        numerator, denominator = self._scale
        self._candidate_start = start
        self._candidate_end = end
        # Whatever ends here or later and holds the pivot is, with the penalty of its age, no better.
        self._proof_end = end - (start - self._pivot_stamp) * denominator // numerator

    def _drop_skipped(self, outcomes: list[Outcome]) -> None:
        for place, cursor in enumerate(self._cursors):
            if cursor:
                messages = self._messages[place]
                outcomes += [Drop(message, DropReason.SUPERSEDED) for message in messages[:cursor]]
                del messages[:cursor]
                del self._stamps[place][:cursor]
                self._cursors[place] = 0

    def _emit(self, outcomes: list[Outcome]) -> None:
        outcomes.append(Match(tuple([messages.pop(0) for messages in self._messages])))
        self.closed = self.opened
        for stamps in self._stamps:
            del stamps[0]
        self._forget_candidate()

    def _is_proved(self) -> bool:
        """Whether no message that may still come could better the candidate.

        The virtual search of message_filters, taken in strides: as long as the end stays, every start up to
        `reach` is as good as passed. An input's head moves the end at most once, when it leaves the pivot
        behind: so there are at most as many strides as inputs, however long the queues.
        """
        numerator, denominator = self._scale
        heads = [
            self._heads[place] if cursor < len(stamps) else self._bound(place)
            for place, (cursor, stamps) in enumerate(zip(self._cursors, self._stamps, strict=True))
        ]
        while True:
            end = max(heads)
            if end >= self._proof_end:
                return True
            reach = self._candidate_start + (end - self._candidate_end) * numerator // denominator
            if min(heads) > reach:
                return False
            for place, head in enumerate(heads):
                if head <= reach:
                    stamps = self._stamps[place]
                    position = bisect_right(stamps, reach)
                    heads[place] = stamps[position] if position < len(stamps) else self._bound(place)

    def _bound(self, place: int) -> int:
        """Give the least stamp that matters of the message that this input has yet to show."""
        return max(self._stamps[place][-1] + self._min_periods[place], self._pivot_stamp)
