"""approximate_time: the best match, as C++ message_filters' ApproximateTime finds it."""

from bisect import bisect_left, bisect_right, insort
from collections.abc import Sequence

from syncrelay.sync.lending import LARGEST_NS, MOST_LENT, Search, SearchTerms
from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Queued, limit_of, of_required
from syncrelay.sync.windows import Tolerances, are_narrowed, tolerances_of, windows_of

_STEPS = 8
"""A search strides only after this many single steps. Most searches take fewer, and a stride costs several steps."""


class ApproximateTime(Queued):
    """The set of least span around each pivot leaves as soon as no later message can make a better one.

    On messages that arrive in stamp order, the sets are those of C++ message_filters' ApproximateTime, at the same
    moments; `slop_ns` is its max interval (inclusive; None for none) and `min_periods_ns` its lower bounds between
    messages. Unlike there, queues are in stamp order, so that messages that arrive out of order are used; a message
    whose stamp is still queued replaces the queued one; and every message that leaves unmatched is reported.

        lidar  |a..b....c
        camera |....B....
        -> B: a superseded
        -> c: bB

    b is nearer to B than a is, but only c shows that no nearer message follows. With a slop of less than 4, a would be
    too far from B.

    The terms are those of message_filters. The heads are the oldest messages that the search has not passed. The pivot
    is the input whose head was the latest when a first candidate was found. The candidate is the best set with the
    pivot's message so far; it is always the front of the queues. Messages between it and the heads are skipped. They
    come back when it leaves.

    Where inputs have `tolerances_ns`, sets are those whose windows share a moment. The search is the same, but while
    the heads' windows share none, the head whose window ends first is passed, as it goes with no later message; and
    only heads that share one can be a candidate.
    """

    __slots__ = (
        "_age_penalty",
        "_are_narrowed",
        "_candidate_end",
        "_candidate_start",
        "_cursors",
        "_heads",
        "_losses",
        "_messages",
        "_min_periods",
        "_overflowed",
        "_pivot",
        "_pivot_stamp",
        "_proof_end",
        "_queue_size",
        "_queues",
        "_scale",
        "_slop",
        "_stamps",
        "_tolerances",
        "_windows",
        "n_inputs",
        "waits_ended",
        "waits_started",
    )

    def __init__(
        self,
        *,
        n_inputs: int,
        queue_size: int,
        slop_ns: int | None,
        age_penalty: float = 0.1,
        min_periods_ns: Sequence[int] | None = None,
        tolerances_ns: Tolerances = None,
    ) -> None:
        periods = (0,) * n_inputs if min_periods_ns is None else tuple(min_periods_ns)
        self.make_queues(n_inputs, queue_size)
        self._slop = limit_of(slop_ns)
        if not 0 <= age_penalty < float("inf"):
            raise ValueError(f"age_penalty {age_penalty} must be 0 or more")
        if len(periods) != n_inputs or any(period < 0 for period in periods):
            raise ValueError(f"min_periods_ns {periods} must be {n_inputs} numbers, 0 or more")
        self._tolerances = tolerances_ns
        self._windows = windows_of(self._slop, tolerances_ns, n_inputs)
        self._are_narrowed = are_narrowed(self._windows, self._slop)
        self._age_penalty = age_penalty
        self._scale = (1.0 + age_penalty).as_integer_ratio()
        self._min_periods = periods
        # The search works on the lists themselves.
        self._stamps = [queue.stamps for queue in self._queues]
        self._messages = [queue.messages for queue in self._queues]
        # (stamp, place) of the head of each input that has one, the earliest first.
        self._heads: list[tuple[int, int]] = []
        self.waits_started = 0
        self._reset()

    def for_required(self, required: Sequence[bool], quorum: int) -> tuple["ApproximateTime", OptionalInputs]:
        policy = ApproximateTime(
            n_inputs=sum(required),
            queue_size=self._queue_size,
            slop_ns=self._slop,
            age_penalty=self._age_penalty,
            min_periods_ns=of_required(self._min_periods, required),
            tolerances_ns=tolerances_of(self._tolerances, required),
        )
        stage = OptionalInputs(
            required=required,
            quorum=quorum,
            queue_size=self._queue_size,
            slop_ns=self._slop,
            min_periods_ns=self._min_periods,
            tolerances_ns=self._tolerances,
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
            insort(self._heads, (stamp, place))
            if len(self._heads) == self.n_inputs:
                outcomes = self._search([])
        if len(stamps) > self._queue_size:
            return self._overflow(place, list(outcomes))
        return outcomes

    def release_oldest(self) -> Sequence[Outcome]:
        outcomes: list[Outcome] = []
        self._emit(outcomes)
        return self._search(outcomes)

    def flush(self, reason: DropReason) -> list[Drop]:
        drops = super().flush(reason)
        self._reset()
        return drops

    def _reset(self) -> None:
        self.waits_ended = self.waits_started
        self._overflowed: set[int] = set()
        self._forget_candidate()

    def _forget_candidate(self) -> None:
        """Forget the candidate: the search begins again at the front of the queues."""
        self._pivot: int | None = None
        self._cursors = [0] * self.n_inputs
        heads = []
        for place, stamps in enumerate(self._stamps):
            if stamps:
                heads.append((stamps[0], place))
        heads.sort()
        self._heads = heads

    @property
    def search_terms(self) -> SearchTerms | None:
        terms = SearchTerms(self._queue_size, self._slop, self._scale, self._min_periods)
        numbers = (*self._scale, *self._min_periods)
        fits = not self._are_narrowed and self.n_inputs * self._queue_size <= MOST_LENT and max(numbers) < LARGEST_NS
        return terms if fits else None

    def lend(self, newest: Sequence[int]) -> Search | None:
        firsts = [stamps[0] if stamps else after for stamps, after in zip(self._stamps, newest, strict=True)]
        # What queues lost tells nothing of messages that come much later.
        if self._overflowed or self._losses.reach(min(firsts) - self._slop):
            return None
        # What a field gives as a stamp may be any number.
        lasts = [stamps[-1] for stamps in self._stamps if stamps]
        if min(firsts) <= -LARGEST_NS or max(*lasts, *newest) >= LARGEST_NS:
            return None
        candidate = None
        if self._pivot is not None:
            ends = self._candidate_start, self._candidate_end, self._proof_end
            candidate = (self._pivot, self._pivot_stamp, *ends)
        return Search(self._messages, self._cursors, newest, candidate)

    def take_back(self, search: Search) -> None:
        for queue, messages in zip(self._queues, search.queues, strict=True):
            queue.messages[:] = messages
            queue.stamps[:] = [message.stamp for message in messages]
        self._forget_candidate()
        self._cursors = list(search.cursors)
        rows = zip(self._stamps, search.cursors, strict=True)
        self._heads = sorted((stamps[at], place) for place, (stamps, at) in enumerate(rows) if at < len(stamps))
        self.waits_ended = self.waits_started
        if search.candidate is not None:
            self._pivot, self._pivot_stamp, *ends = search.candidate
            self._candidate_start, self._candidate_end, self._proof_end = ends
            self.waits_started += 1

    def _feed_behind(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        stamps = self._stamps[place]
        replaced = self._queues[place].insert(stamp, message)
        if replaced is not None:
            return (Drop(replaced, DropReason.DUPLICATE),)
        outcomes: list[Outcome] = []
        if bisect_left(stamps, stamp) <= self._cursors[place]:
            self._forget_candidate()
            self._search_again(outcomes)
        if len(stamps) > self._queue_size:
            self._overflow(place, outcomes)
        return outcomes

    def _overflow(self, place: int, outcomes: list[Outcome]) -> list[Outcome]:
        self._losses.lose(place, self._stamps[place][0])
        self._overflowed.add(place)
        had_candidate = self._pivot is not None
        if had_candidate:
            self._forget_candidate()
        self._drop_oldest(place, 1, DropReason.OVERFLOW, outcomes)
        return self._search_again(outcomes) if had_candidate else outcomes

    def _search_again(self, outcomes: list[Outcome]) -> list[Outcome]:
        """Search after a candidate was forgotten. If there is one again, the wait for a better one goes on."""
        self._search(outcomes)
        if self._pivot is None:
            self.waits_ended = self.waits_started
        return outcomes

    def _search(self, outcomes: list[Outcome]) -> list[Outcome]:
        overflowed = self._overflowed
        numerator, denominator = self._scale
        steps, is_narrowed = 0, self._are_narrowed
        while len(self._heads) == self.n_inputs:
            steps += 1
            if steps > _STEPS and not is_narrowed:
                self._stride(outcomes)
            heads = self._heads
            start, first = heads[0]
            end, latest = heads[-1]
            apart = None
            if is_narrowed and (apart := self._apart()) is not None:
                _, first = heads[apart]
            if overflowed:
                self._excuse_all_but(latest)
            if self._pivot is None:
                if end - start > self._slop or overflowed or apart is not None:
                    self._drop_heads(outcomes, apart)
                    continue
                self._pivot, self._pivot_stamp = latest, end
                self._take_candidate(start, end)
            elif (
                apart is None
                # The penalty only lengthens, so this comparison avoids most of the products.
                and (later_end := end - self._candidate_end) < (later_start := start - self._candidate_start)
                and later_end * numerator < later_start * denominator
            ):
                self._drop_skipped(outcomes)
                self._take_candidate(start, end)
            stamps = self._stamps[first]
            cursor = self._cursors[first] = self._cursors[first] + 1
            del heads[apart or 0]
            awaited = cursor == len(stamps)
            if not awaited:
                insort(heads, (stamps[cursor], first))
            if first == self._pivot or end >= self._proof_end or (awaited and self._is_proved(first)):
                self._emit(outcomes)
        return outcomes

    def _apart(self) -> int | None:
        """Return which head's window ends first, if that is before another's begins."""
        windows = self._windows
        close, apart = min(
            (head + windows[place].after, position) for position, (head, place) in enumerate(self._heads)
        )
        return apart if close < max(head - windows[place].before for head, place in self._heads) else None

    def _drop_heads(self, outcomes: list[Outcome], apart: int | None) -> None:
        """Drop the earliest head, and the messages behind it that would be dropped next because they are too far.

        Where a head is `apart`, drop that. After an overflow, the earliest is dropped even if it is near enough.
        """
        _, place = self._heads[apart or 0]
        next_head, _ = self._heads[1]
        end, _ = self._heads[-1]
        stamps = self._stamps[place]
        count = 1 if self._are_narrowed else bisect_left(stamps, min(next_head, end - self._slop)) or 1
        if len(stamps) == count:
            self._note_missed(place, stamps[-1])
        self._drop_oldest(place, count, DropReason.TOO_FAR, outcomes)

    def _stride(self, outcomes: list[Outcome]) -> None:
        """Pass at once all heads that single steps would pass with the same result.

        With a candidate, these are the messages up to the pivot that do not move a head beyond the latest one. Each of
        these steps is no better than the candidate or, from some step on, better than the step before, so only the last
        one matters. Without a candidate, these are the messages that are too far from the latest head, or all before it
        if its input overflowed. The last message of an input is never passed, as that would end the search.
        """
        end, latest = self._heads[-1]
        if self._pivot is not None:
            if end < self._proof_end:
                self._pass_until(min(self._pivot_stamp, *self._last_stamps(end)))
            return
        self._excuse_all_but(latest)
        target = min(self._last_stamps(end - 1), default=end) if self._overflowed else end - self._slop
        target = min(target, *[stamps[-1] for stamps in self._stamps])
        for head, place in self._heads.copy():
            if head < target:
                count = bisect_left(self._stamps[place], target)
                self._drop_oldest(place, count, DropReason.TOO_FAR, outcomes)

    def _last_stamps(self, end: int) -> list[int]:
        """Return the last stamp up to `end` of each input that has one."""
        lasts = []
        for head, place in self._heads:
            if head <= end:
                stamps = self._stamps[place]
                lasts.append(stamps[bisect_right(stamps, end) - 1])
        return lasts

    def _pass_until(self, target: int) -> None:
        for index, (head, place) in enumerate(self._heads):
            if head < target:
                stamps = self._stamps[place]
                cursor = self._cursors[place] = bisect_left(stamps, target)
                self._heads[index] = (stamps[cursor], place)
        self._heads.sort()

    def _excuse_all_but(self, latest: int) -> None:
        """Forget the overflow of inputs that do not have the latest head. They may be the pivot again."""
        self._overflowed.intersection_update((latest,))

    def _note_missed(self, place: int, start: int) -> None:
        """Note whether messages that would have matched the only message of an input had overflowed."""
        before, after = self._windows[place]
        for head, other in self._heads:
            if head > start:
                window, stamps = self._windows[other], self._stamps[other]
                self._losses.miss(other, stamps, start, before=before + window.after, after=after + window.before)

    def _drop_oldest(self, place: int, count: int, reason: DropReason, outcomes: list[Outcome]) -> None:
        """Drop heads while there is no candidate."""
        stamps = self._stamps[place]
        self._heads.remove((stamps[0], place))
        outcomes += self._queues[place].drop(count, reason)
        if stamps:
            insort(self._heads, (stamps[0], place))

    def _take_candidate(self, start: int, end: int) -> None:
        # The wait for a better one goes on with the next.
        if self.waits_started == self.waits_ended:
            self.waits_started += 1
        numerator, denominator = self._scale
        self._candidate_start = start
        self._candidate_end = end
        # A set with the pivot's message that ends here or later is, with the age penalty, no better.
        self._proof_end = end - (start - self._pivot_stamp) * denominator // numerator

    def _drop_skipped(self, outcomes: list[Outcome]) -> None:
        for place, cursor in enumerate(self._cursors):
            if cursor:
                outcomes += self._queues[place].drop(cursor, DropReason.SUPERSEDED)
                self._cursors[place] = 0

    def _emit(self, outcomes: list[Outcome]) -> None:
        outcomes.append(Match(tuple([messages.pop(0) for messages in self._messages])))
        self.waits_ended = self.waits_started
        for stamps in self._stamps:
            del stamps[0]
        self._forget_candidate()

    def _is_proved(self, awaited: int) -> bool:
        """Tell whether no later message can make a set better than the candidate. Input `awaited` has no head yet.

        This is the virtual search of message_filters, in strides: while the end stays, every start up to `reach` can be
        passed. The head of an input moves the end at most once, when it passes the pivot. So there are at most as many
        strides as inputs, however long the queues are.
        """
        numerator, denominator = self._scale
        heads = [*self._heads, (self._bound(awaited), awaited)]
        while True:
            heads.sort()
            end, _ = heads[-1]
            if end >= self._proof_end:
                return True
            reach = self._candidate_start + (end - self._candidate_end) * numerator // denominator
            if heads[0][0] > reach:
                return False
            for index, (head, place) in enumerate(heads):
                if head <= reach:
                    stamps = self._stamps[place]
                    position = bisect_right(stamps, reach)
                    heads[index] = (stamps[position] if position < len(stamps) else self._bound(place), place)

    def _bound(self, place: int) -> int:
        """Return the least stamp that the next message of this input can have, but at least the pivot's."""
        return max(self._stamps[place][-1] + self._min_periods[place], self._pivot_stamp)
