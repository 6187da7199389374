"""Answers the rules' questions about a group's values by trials on its last messages, within a budget of time."""

from collections.abc import Callable, Hashable, Sequence
from typing import Final

from syncrelay.config import GroupConfig
from syncrelay.explain.received import as_arrays
from syncrelay.explain.rhythm import LEAST_PERIOD
from syncrelay.explain.trials import UNTRIED, Trials, Verdict
from syncrelay.explain.try_budget import OutOfTimeError, TryBudget
from syncrelay.sync import Message

_SECOND: Final = 1_000_000_000
# A trial on a window takes some milliseconds: this many messages of the slowest input, or those of this long ...
_PIVOTS: Final = 100
_AT_LEAST: Final = 5 * _SECOND
# ... but no more than this many messages of all inputs. On a slow machine the limit is halved, down to the last.
_MOST_MESSAGES: Final = 4_000
_LEAST_MESSAGES: Final = 500
# An answer holds for a second, then for twice as long each time, up to this.
_HOLDS: Final = 8 * _SECOND


class Suggester:
    """Answers the questions of a group's rules by trials on its last messages, within a budget; keeps the answers.

    `recent` gives stamps and times of receipt of each input. Where `whole` gives trials on a whole recording, the
    values and their figures are theirs; whether sets may be missed goes by the last messages, as in the running relay.
    """

    def __init__(
        self,
        config: GroupConfig,
        recent: Callable[[], Sequence[Sequence[tuple[int, int]]]],
        budget: TryBudget | None = None,
        whole: Callable[[], Trials] | None = None,
    ) -> None:
        self._config = config
        self._recent = recent
        # Without one to share, time does not count: `int` is a clock that stands still at 0.
        self._budget = budget or TryBudget(clock=int)
        self._is_shared = budget is not None
        self._whole = whole
        self._most_messages = _MOST_MESSAGES
        self._trials: Trials | None = None
        self._at = 0
        self._holds = 0
        self._next: tuple[int, Trials] | None = None
        self._answers: dict[Hashable, Verdict] = {}
        self._awaited: set[Hashable] = set()

    def awaits(self, about: Hashable) -> bool:
        """Whether there was no time yet to try anything for what was asked about."""
        return about in self._awaited

    def ask(self, about: Hashable, question: Callable[[Trials], Verdict], *, now: int) -> Verdict:
        """Return the answer to a question; the last one to it where the budget is spent, UNTRIED if there is none."""
        is_held = self._trials is not None and 0 <= now - self._at < self._holds
        if is_held and about in self._answers:
            return self._answers[about]
        if not self._is_shared:
            self._budget.refill()
        before = self._answers.get(about)
        if self._budget.is_spent or (before is not None and self._budget.is_short):
            # What was never tried goes first.
            if before is None:
                self._budget.want()
            return self._not_yet(about)
        if not is_held:
            self._next = self._next or (now, self._window())
        at, trials = self._next or (self._at, self._trials)
        found = self._found(question, trials) if trials is not None else None
        if found is None:
            return self._not_yet(about)
        if self._next is not None:
            # Whatever else is asked now is answered by the same messages, so that a key has one value.
            self._holds = min(_HOLDS, 2 * self._holds or _SECOND)
            self._trials, self._at, self._next, self._answers = trials, at, None, {}
        self._awaited.discard(about)
        self._answers[about] = found
        return found

    def _not_yet(self, about: Hashable) -> Verdict:
        if about not in self._answers:
            self._awaited.add(about)
        return self._answers.get(about, UNTRIED)

    def _found(self, question: Callable[[Trials], Verdict], trials: Trials) -> Verdict | None:
        """Return the answer to a question, None where the budget does not last; the next poll goes on from there."""
        runs = trials.runs
        try:
            found = question(trials)
            if self._whole is not None and found.may_miss:
                found = found._replace(tried=question(self._whole()).tried)
        except OutOfTimeError:
            if trials.runs == runs:
                # Not a single run fits into a poll.
                self._most_messages = max(_LEAST_MESSAGES, self._most_messages // 2)
                self._next = None
            return None
        return found

    def _window(self) -> Trials:
        config, most = self._config, self._most_messages
        recent = self._recent()
        pacemaker = config.trigger
        if pacemaker is None:
            rates = [_rate(each) for each in recent]
            pacemaker = min(config.enough(rates), key=rates.__getitem__)
        # A run takes as long for a tick as for a message.
        longest = None if config.ticks is None else most * config.ticks.period_ns
        messages = _last(recent, pacemaker, longest)[-most:]
        inputs = as_arrays(messages, len(config.topics))
        return Trials(config, inputs, is_window=True, passed=self._budget.spent_on)


def _last(
    recent: Sequence[Sequence[tuple[int, int]]], pacemaker: int, longest: int | None = None
) -> tuple[Message, ...]:
    """Return the last messages in the order of receipt: a number of the slowest input's, and what came since.

    Where it may be no `longest` than a time, in nanoseconds, what came before that is left out.
    """
    since = recent[pacemaker][-_PIVOTS:]
    begin = min(since[0][1], since[-1][1] - _AT_LEAST) if since else 0
    if since and longest is not None:
        begin = max(begin, max(each[-1][1] for each in recent if each) - longest)
    came = [
        Message(index, stamp, received)
        for index, each in enumerate(recent)
        for place, (stamp, received) in enumerate(each)
        # What is held until there is a newer one may have come long before.
        if received >= begin or place == len(each) - 1 or each[place + 1][1] >= begin
    ]
    return tuple(sorted(came, key=lambda each: each.payload))


def _rate(pairs: Sequence[tuple[int, int]]) -> float:
    return (len(pairs) - 1) / max(LEAST_PERIOD, pairs[-1][1] - pairs[0][1]) if pairs else 0.0
