"""A group at work: what all policies share."""

from collections.abc import Sequence
from typing import Generic

from syncrelay.sync.arrivals import Arrivals
from syncrelay.sync.counts import InputCounts, Ledger
from syncrelay.sync.lending import Fed, Search, SearchTerms
from syncrelay.sync.matching import Limited, Prompt
from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome, Restamp, T, common_stamp
from syncrelay.sync.policy import Policy
from syncrelay.sync.thinning import Thinning
from syncrelay.sync.transforms import Lapse, Transforms, TransformStage


class SyncGroup(Generic[T]):
    """Runs one policy: feeds it the messages that are of use, lets sets leave in time, and counts every message.

    Messages leave with the stamps that they came with. An input's offset is added for matching only.
    - A message is `late` if it is older than the last message of its input that went into a set, or of the same stamp.
    - A stamp more than a second below its input's newest flushes the group (`time_jump`), which forgets the time
      before. What other inputs still send of that time is dropped for the same reason.
    - Inputs that are not `required` never change which messages of the required ones are a set. A set leaves when no
      better message of them can come, or `max_wait_ns` after its required messages were all there, and messages of
      `quorum` inputs in all. Where no input is required, a set is any so many messages that fit.
    - `max_wait_ns` after a first complete set was there, the best set so far leaves. Without it, a set waits as long as
      the policy has it wait, and only latest_time, whose sets do not wait for others, may have optional inputs.
    - Where a clock triggers, `now` is the time of that clock, in nanoseconds since the epoch of the stamps. The set of
      a tick leaves `max_wait_ns` after the tick (0 without it), with the messages that were added before.
    - `restamp` gives the messages of a set a common stamp. `every` and `min_set_period_ns` thin sets.
    - With `transforms` a set waits, after it was matched, until all of its messages can be transformed at the stamps
      with which they leave. Call `expire` when more transforms are known.

    `add` first lets leave what was due before it, so calling `expire` more often changes nothing.
    """

    __slots__ = (
        "_arrivals",
        "_by_stamp",
        "_feed",
        "_is_limited",
        "_is_plain",
        "_ledger",
        "_matching",
        "_newest",
        "_offsets",
        "_required",
        "_restamp",
        "_stage",
        "_thinning",
        "at_once",
    )

    def __init__(
        self,
        policy: Policy,
        *,
        required: Sequence[bool] | None = None,
        quorum: int | None = None,
        max_wait_ns: int | None = None,
        offsets_ns: Sequence[int] | None = None,
        restamp: Restamp | int | None = None,
        every: int = 1,
        min_set_period_ns: int | None = None,
        transforms: Transforms | None = None,
        most_waiting: int = 10,
    ) -> None:
        """Run a policy that has not been fed anything.

        `required` (default: all), and `offsets_ns`, which is added to the stamps for matching, have a value for each
        input. `quorum` is how many inputs a set needs, the required ones included (default: no more than these). At
        most `most_waiting` sets wait for transforms. Durations are in nanoseconds. Raises ValueError for what is not
        so, or cannot be.
        """
        n_inputs = policy.n_inputs
        required = (True,) * n_inputs if required is None else required
        offsets = (0,) * n_inputs if offsets_ns is None else tuple(offsets_ns)
        needed = sum(required) if quorum is None else quorum
        if len(required) != n_inputs or len(offsets) != n_inputs or not 0 < needed <= n_inputs:
            raise ValueError(
                f"required {required} and offsets_ns {offsets} must be {n_inputs}, one required, quorum {quorum}"
            )
        if max_wait_ns is not None and max_wait_ns < 0:
            raise ValueError(f"max_wait_ns {max_wait_ns} must be 0 or more")
        if isinstance(restamp, int) and not 0 <= restamp < n_inputs:
            raise ValueError(f"restamp {restamp} must be one of {n_inputs} inputs")
        if restamp is Restamp.TICK and not policy.by_clock:
            raise ValueError("restamp TICK must have a policy with a clock")
        self._by_stamp = policy.by_stamp
        self._required = [index for index, needed in enumerate(required) if needed]
        self._offsets = offsets
        self._restamp = restamp
        self._ledger = Ledger(n_inputs, repeats=policy.repeats)
        self._arrivals = Arrivals(offsets)
        self._newest = self._arrivals.newest
        self._thinning = None
        if every != 1 or min_set_period_ns is not None:
            self._thinning = Thinning(
                n_inputs=n_inputs, repeats=policy.repeats, every=every, min_set_period_ns=min_set_period_ns
            )
        self._stage = None
        if transforms is not None:
            self._stage = TransformStage(transforms, n_inputs=n_inputs, repeats=policy.repeats, most=most_waiting)
        self._is_limited = max_wait_ns is not None or policy.by_clock or transforms is not None
        self._matching: Prompt | Limited
        if policy.by_clock or max_wait_ns is None:
            self._matching = Prompt(policy, required=required, quorum=needed, max_wait_ns=max_wait_ns or 0)
        else:
            self._matching = Limited(
                policy,
                self._arrivals,
                required=required,
                quorum=needed,
                max_wait_ns=max_wait_ns,
                offsets_ns=offsets,
            )
        self._feed = self._matching.feed
        is_plain = all(required) and not any(offsets) and not self._is_limited
        is_plain &= self._thinning is None and restamp is None
        self._is_plain = is_plain
        self.at_once = policy.at_once if is_plain else None
        """How far apart the stamps of what `lend` lets another match may be; None where it always returns None."""

    @property
    def sets(self) -> int:
        """How many sets have left."""
        return self._ledger.sets

    @property
    def lapses(self) -> Sequence[Lapse]:
        """The sets that were given up last because they could not be transformed, oldest first."""
        return () if self._stage is None else self._stage.lapses

    def add(self, message: Message[T], *, now: int) -> Sequence[Outcome[T]]:
        """Take a message that arrives at `now`; return what leaves because of it, in order."""
        index = message.input
        stamp = message.stamp
        self._ledger.fed[index] += 1
        due = self.expire(now=now) if self._is_limited else ()
        if stamp <= self._newest[index]:
            outcomes = self._take_behind(message)
        else:
            self._newest[index] = stamp
            outcomes = self._feed(index, stamp + self._offsets[index], message)
        if outcomes:
            outcomes = self._leave(outcomes, now)
        return [*due, *outcomes] if due else outcomes

    def lend(self) -> Sequence[int] | None:
        """Let another match what comes, until `take_back`; None where what is in here has a part in it.

        It may form sets of one message of each input, that is newer than what came of it before, and no farther from
        the others than `at_once`; whatever else comes is for the engine, once it was given the messages that are in no
        set yet. Returned is the newest stamp of each input.
        """
        if self.at_once is None or not isinstance(self._matching, Prompt) or not self._matching.is_new:
            return None
        return self._newest

    def take_back(self, sets: int, newest: Sequence[int]) -> None:
        """Match again, after so many sets that another has formed; given are the stamps of the last one."""
        if not sets:
            return
        self._ledger.note_sets(sets)
        self._arrivals.note_set(newest)

    @property
    def search_terms(self) -> SearchTerms | None:
        """What the search goes by that `lend_search` lends; None where it always returns None."""
        return self._matching.search_terms if self._is_plain and isinstance(self._matching, Prompt) else None

    def lend_search(self) -> Search | None:
        """Let another search, until `take_back_search`; None where what queues lost has a part in it.

        It may take messages that are newer than what came of their input before, below LARGEST_NS, while there is room
        in the queue. Whatever else comes is for the engine, once it has its search back.
        """
        if self.search_terms is None or not isinstance(self._matching, Prompt):
            return None
        return self._matching.lend(self._newest)

    def take_back_search(self, search: Search, sets: int, inputs: Sequence[Fed]) -> None:
        """Go on where another has left the search, after so many sets and after what came of each input."""
        if isinstance(self._matching, Prompt):
            self._matching.take_back(search)
        self._ledger.note_lent(sets, inputs)
        self._arrivals.note_lent(search.newest, [each.given for each in inputs])

    def reject(self, message: Message[T], reason: DropReason) -> Drop[T]:
        """Count a message that cannot be fed: it has no readable stamp."""
        self._ledger.fed[message.input] += 1
        drop = Drop(message, reason)
        self._ledger.note((drop,))
        return drop

    def next_deadline(self) -> int | None:
        """Return the `now` at which `expire` has something to do; None if not before the next message."""
        deadline = self._matching.next_deadline()
        staged = None if self._stage is None else self._stage.next_deadline()
        if deadline is None or (staged is not None and staged < deadline):
            return staged
        return deadline

    def expire(self, *, now: int) -> Sequence[Outcome[T]]:
        """Return what leaves because it has waited long enough, or because more transforms are known."""
        outcomes = self._matching.due(now)
        left = self._leave(outcomes, now) if outcomes else outcomes
        if self._stage is None:
            return left
        return [*left, *self._depart(self._stage.release(now), now)]

    def pass_over(self, *, now: int) -> None:
        """Let time pass without the sets that a clock would trigger, as nobody wants them."""
        self._matching.pass_over(now)

    def flush(self, reason: DropReason) -> Sequence[Drop[T]]:
        """Drop everything that is buffered and start afresh. The counts go on."""
        drops = self._empty(reason)
        self._arrivals.forget()
        self._ledger.note(drops)
        return drops

    def let_go(self, reason: DropReason) -> Sequence[Drop[T]]:
        """Drop what waits for other messages. Later sets are not older than those before, as nothing else is forgotten.

        The latest messages of inputs whose messages can be in many sets stay.
        """
        drops = [*(self._stage.let_go(reason) if self._stage is not None else ()), *self._matching.let_go(reason)]
        self._ledger.note(drops)
        return drops

    def counts(self) -> tuple[InputCounts, ...]:
        """Return what became of the messages of each input since the group was made."""
        inputs = range(len(self._offsets))
        buffered = [self._matching.buffered(index) for index in inputs]
        if self._stage is not None:
            buffered = [held + self._stage.buffered(index) for index, held in enumerate(buffered)]
        if self._thinning is not None:
            buffered = [held + self._thinning.buffered(index) for index, held in enumerate(buffered)]
        return self._ledger.counts(buffered, [self._matching.needed_queue(index) for index in inputs])

    def _take_behind(self, message: Message) -> Sequence[Outcome]:
        """Take a message that is not newer than all before: unstamped, late, out of order or after a jump."""
        index, stamp = message.input, message.stamp
        if stamp == 0:
            if self._by_stamp:
                return (Drop(message, DropReason.UNSTAMPED),)
            return self._feed(index, stamp, message)
        if self._arrivals.is_left_over(index, stamp):
            return (Drop(message, DropReason.TIME_JUMP),)
        drops: list[Drop] = []
        if self._arrivals.has_fallen(index, stamp):
            drops = self._empty(DropReason.TIME_JUMP)
            self._arrivals.jump(index)
        if self._arrivals.is_late(index, stamp, or_equal=self._by_stamp):
            return (Drop(message, DropReason.LATE),)
        self._newest[index] = max(stamp, self._newest[index])
        return [*drops, *self._feed(index, stamp + self._offsets[index], message)]

    def _empty(self, reason: DropReason) -> list[Drop]:
        drops = [*(self._stage.flush(reason) if self._stage is not None else ()), *self._matching.flush(reason)]
        if self._thinning is not None:
            drops += self._thinning.flush(reason)
        self._ledger.forget()
        return drops

    def _leave(self, outcomes: Sequence[Outcome], now: int) -> Sequence[Outcome]:
        """Note which messages went into sets, also into those that will not leave; restamp and hold sets."""
        for outcome in outcomes:
            if isinstance(outcome, Match):
                self._arrivals.give(outcome.messages)
        if self._restamp is not None:
            outcomes = [
                Match(outcome.messages, common_stamp(outcome, self._restamp), outcome.tick)
                if isinstance(outcome, Match)
                else outcome
                for outcome in outcomes
            ]
        if self._stage is not None:
            outcomes = self._stage.take(outcomes, now)
        return self._depart(outcomes, now)

    def _depart(self, outcomes: Sequence[Outcome], now: int) -> Sequence[Outcome]:
        """Thin and count what leaves."""
        if self._thinning is not None:
            outcomes = self._thinned(outcomes, self._thinning, now)
        self._ledger.note(outcomes)
        return outcomes

    def _thinned(self, outcomes: Sequence[Outcome], thinning: Thinning, now: int) -> list[Outcome]:
        left: list[Outcome] = []
        for outcome in outcomes:
            if isinstance(outcome, Match):
                left += thinning.thin(outcome, self._moment(outcome, now))
            else:
                left.append(outcome)
        return left

    def _moment(self, match: Match, now: int) -> int:
        """Return a stamp that rises from set to set: the tick, the latest of the required inputs, or `now`.

        Where none is required, it is that of the first message: the set was made round it.
        """
        if match.tick is not None:
            return match.tick
        stamps = [
            message.stamp + self._offsets[message.input]
            for message in match.messages
            if message is not None and message.stamp and (message.input in self._required or not self._required)
        ]
        if not self._required:
            return stamps[0]
        return max(stamps, default=now)
