"""approximate_time_eager: the first match, without waiting for a better one."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Queued, limit_of
from syncrelay.sync.windows import Tolerances, Window, are_narrowed, tolerances_of, windows_of


class ApproximateTimeEager(Queued):
    """The tightest set within slop that has the message that has just arrived leaves at once.

    Of sets of the same span, the one that starts first leaves, in which each input has its latest message that is not
    newer than the arrived one; where inputs have `tolerances_ns`, its oldest that may be in that set. Messages older
    than a set that leaves are superseded, so sets never go back. A message that is too old for all messages of another
    input is too far. This is for users of Python's ApproximateTimeSynchronizer, whose slop is exclusive, which takes
    the first set that fits, and whose cost is a product of queues.

        lidar  |a..b..cd
        camera |..A....D
        -> A: aA
        -> D: b too_far, c superseded, dD

    Slop is 2. aA does not wait for b, which is nearer to A and comes a little later.
    """

    __slots__ = (
        "_are_narrowed",
        "_in_window",
        "_losses",
        "_messages",
        "_queue_size",
        "_queues",
        "_slop",
        "_stamps",
        "_tolerances",
        "_windows",
        "n_inputs",
    )

    def __init__(
        self, *, n_inputs: int, queue_size: int, slop_ns: int | None, tolerances_ns: Tolerances = None
    ) -> None:
        self.make_queues(n_inputs, queue_size)
        self._slop = limit_of(slop_ns)
        self._tolerances = tolerances_ns
        self._windows = windows_of(self._slop, tolerances_ns, n_inputs)
        self._are_narrowed = are_narrowed(self._windows, self._slop)
        # The lists themselves: a queue's attributes and a zip of these cost more than the search, most of the time.
        self._stamps = [queue.stamps for queue in self._queues]
        self._messages = [queue.messages for queue in self._queues]
        self._in_window = list(zip(self._stamps, self._windows, strict=True))

    @property
    def at_once(self) -> int:
        return 0 if self._are_narrowed else self._slop

    def for_required(self, required: Sequence[bool], quorum: int) -> tuple["ApproximateTimeEager", OptionalInputs]:
        size, slop, tolerances = self._queue_size, self._slop, self._tolerances
        policy = ApproximateTimeEager(
            n_inputs=sum(required),
            queue_size=size,
            slop_ns=slop,
            tolerances_ns=tolerances_of(tolerances, required),
        )
        stage = OptionalInputs(
            required=required, quorum=quorum, queue_size=size, slop_ns=slop, tolerances_ns=tolerances
        )
        return policy, stage

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        stamps = self._stamps[place]
        outcomes: list[Outcome] = []
        if not stamps or stamp > stamps[-1]:
            stamps.append(stamp)
            self._messages[place].append(message)
            if len(stamps) == 1:
                self._begin(place, stamp, outcomes)
        elif (replaced := self._queues[place].insert(stamp, message)) is not None:
            outcomes.append(Drop(replaced, DropReason.DUPLICATE))
        elif stamps[0] == stamp:
            self._drop_too_far(outcomes)
        if all(self._stamps):
            # There was no set before, so this is the only message of its input. The first messages of all inputs are
            # near enough to each other, so there is a set now.
            self._match(stamp, outcomes)
        if len(stamps) > self._queue_size:
            self._losses.lose(place, stamps[0])
            outcomes += self._queues[place].drop(1, DropReason.OVERFLOW)
            self._drop_too_far(outcomes)
        return outcomes

    def _begin(self, place: int, stamp: int, outcomes: list[Outcome]) -> None:
        """Note which overflowed messages the only message of its input has missed, and drop what is too far."""
        before, after = self._windows[place]
        begin, end = stamp - before, stamp + after
        # The windows of the other first messages share a moment, so those of all do if each shares one with this.
        for stamps, (earlier, later) in self._in_window:
            if stamps and not begin - later <= stamps[0] <= end + earlier:
                break
        else:
            return
        for other, (stamps, window) in enumerate(self._in_window):
            if stamps and stamps[0] > end + window.before:
                self._losses.miss(other, stamps, stamp, before=before + window.after, after=after + window.before)
        self._drop_too_far(outcomes)

    def _drop_too_far(self, outcomes: list[Outcome]) -> None:
        """Drop messages that go with no message that another input has or will send."""
        while True:
            firsts = [(stamps[0], window) for stamps, window in self._in_window if stamps]
            close = min([first + window.after for first, window in firsts], default=0)
            begin = max([first - window.before for first, window in firsts], default=0)
            if close >= begin:
                return
            for queue, window in zip(self._queues, self._windows, strict=True):
                outcomes += queue.drop(bisect_left(queue.stamps, begin - window.after), DropReason.TOO_FAR)

    def _match(self, stamp: int, outcomes: list[Outcome]) -> None:
        if max(map(len, self._stamps)) == 1:
            # The usual case: there is no choice, and nothing is left over.
            outcomes.append(Match(tuple([messages.pop() for messages in self._messages])))
            for stamps in self._stamps:
                stamps.clear()
            return
        members = []
        best = _in_windows(self._stamps, self._windows) if self._are_narrowed else _tightest(stamp, self._stamps)
        for queue, wanted in zip(self._queues, best, strict=True):
            if queue.stamps[0] != wanted:
                outcomes += queue.drop(bisect_left(queue.stamps, wanted), DropReason.SUPERSEDED)
            members.append(queue.remove(0))
        outcomes.append(Match(tuple(members)))
        self._drop_too_far(outcomes)


def _tightest(stamp: int, queues: Sequence[Sequence[int]]) -> list[int]:
    """Return the stamps of the tightest set with `stamp`, one for each input; of equal spans, the first.

    Of each input only its last stamp up to `stamp` or its first one after it can be in the tightest set. The search
    begins with the last stamps up to `stamp`. It replaces the earliest one by the next of its input, again and again,
    until an input has no next one, as the input of `stamp` has none.
    """
    after = [bisect_right(stamps, stamp) for stamps in queues]
    best = [stamps[max(position - 1, 0)] for stamps, position in zip(queues, after, strict=True)]
    candidate = best.copy()
    earliest = iter(sorted(range(len(queues)), key=best.__getitem__))
    while after[place := next(earliest)] < len(queues[place]):
        candidate[place] = queues[place][after[place]]
        if max(candidate) - min(candidate) < max(best) - min(best):
            best = candidate.copy()
    return best


def _in_windows(queues: Sequence[Sequence[int]], windows: Sequence[Window]) -> list[int]:
    """Return the stamps of the tightest set whose windows share a moment; of equal spans the first, of its oldest.

    The first stamps are one, and the arrived message is the only one of its input. While the windows share a moment,
    the earliest stamp is replaced by the next of its input; while they do not, the one whose window ends first, as it
    goes with no later one.
    """
    heads, rests = [stamps[0] for stamps in queues], [iter(stamps[1:]) for stamps in queues]
    best = heads.copy()
    while True:
        closes = [head + window.after for head, window in zip(heads, windows, strict=True)]
        place = closes.index(min(closes))
        if closes[place] >= max(head - window.before for head, window in zip(heads, windows, strict=True)):
            if max(heads) - min(heads) < max(best) - min(best):
                best = heads.copy()
            place = heads.index(min(heads))
        following = next(rests[place], None)
        if following is None:
            return best
        heads[place] = following
