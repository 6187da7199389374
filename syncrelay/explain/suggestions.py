"""What other values of the file would give: the engine itself, run on the messages that came last."""

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from statistics import median
from typing import Any, Final, NamedTuple, TypeAlias

from syncrelay.config import Distance, GroupConfig
from syncrelay.config.file import file_format
from syncrelay.config.units import parse_duration
from syncrelay.explain import words
from syncrelay.explain.distribution import Distribution
from syncrelay.explain.dry_run import dry_run
from syncrelay.explain.input_observation import Arrivals
from syncrelay.explain.nearest import NearestSpans, signed_distances
from syncrelay.explain.try_budget import OutOfTimeError, TryBudget
from syncrelay.sync import DropReason, Message
from syncrelay.sync.queues import LONGEST_QUEUE

_SECOND: Final = 1_000_000_000
# A try takes some milliseconds: so many messages of the input that sets the pace, and so many of all together ...
_PIVOTS: Final = 100
# ... or those of so long, as late ones take.
_AT_LEAST: Final = 5 * _SECOND
_MOST_MESSAGES: Final = 4_000
_LEAST_MESSAGES: Final = 500
# From fewer possible sets nothing can be told.
_FEWEST: Final = 5
# All possible sets but one, which may still wait for what comes next, or but this share.
_LEFT_OUT: Final = 0.05
# Farther away than so many periods, or than so many times what is usual, a partner is missing: it is another one.
_PERIODS: Final = 1.5
_FAR_OFF: Final = 4
# A queue that was too short is tried longer by this factor again and again; what does is suggested with a quarter more.
_LONGER: Final = 2
_HEADROOM: Final = 1.25
# What was tried holds for so long while its finding stands: the first time for a second, then twice as long each time.
_TRIED_AGAIN: Final = _SECOND
_HOLDS: Final = 8 * _SECOND
# Less is not told apart from what a driver takes.
_LEAST_DISTANCE: Final = 1_000_000
# Of a period: so near to one another are messages of one moment received.
_SAME: Final = 0.15


class Change(NamedTuple):
    """A value to write: of a group, or of one of its inputs."""

    key: str
    value: str
    input: int | None = None


Changes: TypeAlias = tuple[Change, ...]


@dataclass(frozen=True, slots=True)
class Tried:
    """What changes would have given: `given` messages of an input in sets in place of `now`, of `possible` ones."""

    changes: Changes
    given: int
    now: int
    possible: int


class Verdict(NamedTuple):
    """What helps, and whether the file's values may miss sets: not where what came can be told to give all it could."""

    tried: tuple[Tried, ...]
    may_miss: bool = True


UNTRIED: Final = Verdict(())


class Evaluator:
    """Tries values for a group on its last messages, as `recent` gives them. Keeps what it found for a while."""

    def __init__(
        self, config: GroupConfig, recent: Callable[[], Sequence[Arrivals]], budget: TryBudget | None = None
    ) -> None:
        self._config = config
        self._recent = recent
        self._budget = budget or TryBudget(clock=None)
        self._is_shared = budget is not None
        self._most_messages = _MOST_MESSAGES
        self._unfinished: tuple[Hashable, Trials] | None = None
        self._found: dict[Hashable, _Found] = {}
        self._awaited: set[Hashable] = set()

    def awaits(self, about: Hashable) -> bool:
        """Whether there was no time yet to try anything for what was asked about."""
        return about in self._awaited

    def best(
        self,
        about: Hashable,
        propose: Callable[["Trials"], Iterator[Tried]],
        *,
        now: int,
        within: int | None = None,
        optional: int | None = None,
        given: Changes = (),
    ) -> Verdict:
        """Return what `propose` finds, now and then for each `about`; nothing new once the budget is spent.

        What was found on many messages stands as long as it helps, with the figures of now. See Trials for
        `within` and `optional`. With changes `given`, these are what the possible sets are measured by.
        """
        at, holds, verdict = self._found.get(about, _NOTHING)
        if 0 <= now - at < holds:
            return verdict
        if not self._is_shared:
            self._budget.refill()
        if self._budget.is_spent or (holds and self._budget.is_short):
            # What was never tried goes first.
            if not holds:
                self._budget.want()
                self._awaited.add(about)
            return verdict
        begun, self._unfinished = self._unfinished, None
        if begun is not None and begun[0] == about:
            trials = begun[1]
        else:
            most = self._most_messages
            config = changed(self._config, given)
            trials = Trials(config, self._recent(), self._budget, within=within, optional=optional, most=most)
        runs = trials.runs
        try:
            before = verdict.tried if holds == _HOLDS and not given else ()
            again = tuple(tried for each in before if (tried := trials.gives_enough(each.changes)) is not None)
            found = again if before and len(again) == len(before) else tuple(propose(trials))
            verdict = Verdict(found, may_miss=trials.may_miss)
        except OutOfTimeError:
            if trials.runs > runs:
                # The next poll goes on from here.
                self._unfinished = about, trials
            else:
                self._most_messages = max(_LEAST_MESSAGES, self._most_messages // 2)
            if not holds:
                self._awaited.add(about)
            return verdict
        self._awaited.discard(about)
        self._found[about] = _Found(now, min(_HOLDS, 2 * holds or _TRIED_AGAIN), verdict)
        return verdict

    def offset(self, about: Hashable, change: Change, *, now: int) -> Tried | None:
        """Return what another offset gives if it brings messages together that are possible sets by then, else None."""

        def all_in_all(trials: Trials) -> Iterator[Tried]:
            if (given := trials.given_enough()) is not None:
                yield Tried((change,), given, 0, len(trials.spans))

        return next(iter(self.best(about, all_in_all, now=now, given=(change,)).tried), None)


class _Found(NamedTuple):
    """What was found, when, and for how long it holds."""

    at: int
    holds: int
    verdict: Verdict


_NOTHING: Final = _Found(0, 0, UNTRIED)


class Trials:
    """Runs of a group's engine on its last messages.

    What they give is measured by the sets that the input that sets the pace allows, or of those that an `optional` one
    could be in; no wider than `within`, where it is given. `spans` are those of the tightest possible sets, `stamps`
    and `delays` those of each input, offsets added to the stamps.
    """

    def __init__(
        self,
        config: GroupConfig,
        recent: Sequence[Arrivals],
        budget: TryBudget,
        *,
        within: int | None = None,
        optional: int | None = None,
        most: int = _MOST_MESSAGES,
    ) -> None:
        self.config = config
        self._budget = budget
        self._trigger = config.trigger
        required = [index for index, topic in enumerate(config.topics) if topic.required]
        pacemaker = min(required, key=lambda index: _rate(recent[index])) if self._trigger is None else self._trigger
        self._messages = _last(recent, pacemaker)[-most:]
        self.stamps: list[list[int]] = [[] for _ in config.topics]
        self.delays: list[list[int]] = [[] for _ in config.topics]
        for each in self._messages:
            stamp = each.stamp + config.topics[each.input].offset_ns
            self.stamps[each.input].append(stamp)
            self.delays[each.input].append(each.payload - stamp)
        # Those that have a tolerance of their own go by no value that is tried.
        own = config.own_tolerances
        required = [index for index in required if own[index] is None] or required
        among = self.among = required if optional is None else [*required, optional]
        slowest = min(among, key=lambda index: len(self.stamps[index]))
        self.pivot: int = slowest if self._trigger is None else self._trigger
        self.spans = self._possible(among, within)
        self._counted = self.pivot if optional is None else optional
        self._given: dict[Changes, int] = {}

    @property
    def runs(self) -> int:
        """How many runs there were."""
        return len(self._given)

    @property
    def _now(self) -> int:
        return self._run(())

    @property
    def may_miss(self) -> bool:
        """Whether sets may be missed that other values would give."""
        is_certain = len(self.stamps[self.pivot]) >= 2 * _FEWEST
        return not (is_certain and (len(self.spans) < _FEWEST or self._is_enough(self._now)))

    def try_out(self, changes: Changes, *, need: int | None = None) -> Tried | None:
        """Return what changes give if that is enough, with a longer queue where they need one; else None.

        `need` is how long the queue should have been by what the engine saw.
        """
        if len(self.spans) < _FEWEST or self._is_enough(self._now):
            return None
        if changes and (tried := self.gives_enough(changes)) is not None:
            return tried
        longer = _LONGER * self.config.options.queue_size
        size = need if need is not None and need > self.config.options.queue_size else longer
        while size <= LONGEST_QUEUE and not self._budget.has_ended:
            if self._is_enough(self._run((*changes, _queue(size)))):
                return self.gives_enough((*changes, _queue(min(LONGEST_QUEUE, ceil(size * _HEADROOM) + 1))))
            size *= _LONGER
        return None

    def gives_enough(self, changes: Changes) -> Tried | None:
        """Return what changes give if that is enough and was not without them, else None."""
        if len(self.spans) < _FEWEST or self._is_enough(self._now):
            return None
        given = self._run(changes)
        return Tried(changes, given, self._now, len(self.spans)) if self._is_enough(given) else None

    def given_enough(self) -> int | None:
        """Return how many sets there are as it is, if these are enough of the possible ones, else None."""
        return self._now if len(self.spans) >= _FEWEST and self._is_enough(self._now) else None

    def _is_enough(self, given: int) -> bool:
        return given >= len(self.spans) - max(1, int(_LEFT_OUT * len(self.spans)))

    def _run(self, changes: Changes) -> int:
        if changes not in self._given:
            self._given[changes] = self._completed(changes)
        return self._given[changes]

    def _completed(self, changes: Changes) -> int:
        run = dry_run(changed(self.config, changes), self._budget.spent_on(self._messages))
        counts = run.counts[self._counted]
        # A message that is held may be in many sets.
        completed = max(run.held[self._counted], counts.matched + counts.dropped.get(DropReason.THINNED, 0))
        return min(completed, len(self.spans))

    def _possible(self, among: Sequence[int], within: int | None) -> Distribution:
        if len(among) == 1:
            return Distribution([0] * len(self.stamps[self.pivot]))
        distance = self.config.options.distance
        spans = NearestSpans(len(among), distance).add(
            [self.stamps[index] for index in among], pivot=among.index(self.pivot)
        )
        if spans and distance is Distance.SPAN:
            # Where most lie close together, what lies far off has lost its partner.
            limit = _FAR_OFF * Distribution(spans).quantile(0.75)
            limit = min(limit, round(_PERIODS * max(_period(self.stamps[i]) for i in among if i != self.pivot)))
            spans = [span for span in spans if span <= limit]
        return Distribution([span for span in spans if within is None or span <= within])


def _last(recent: Sequence[Arrivals], pacemaker: int) -> tuple[Message, ...]:
    """Return the messages that came since so many of the input that sets the pace, as a dry run takes them."""
    since = recent[pacemaker][-_PIVOTS:]
    begin = min(since[0][1], since[-1][1] - _AT_LEAST) if since else 0
    came = [
        Message(index, stamp, received)
        for index, each in enumerate(recent)
        for place, (stamp, received) in enumerate(each)
        # What is held until there is a newer one may have come long before.
        if received >= begin or place == len(each) - 1 or each[place + 1][1] >= begin
    ]
    return tuple(sorted(came, key=lambda each: each.payload))


def with_headroom(spans: Distribution) -> str:
    """Return the tolerance, as it stands in the file, that takes in 99 % of spans, and what they scatter by."""
    most = spans.quantile(0.99)
    return words.at_least(most + (most - spans.quantile(0.5)) // 2)


def changed(config: GroupConfig, changes: Changes) -> GroupConfig:
    """Return a group as it would be with other values in the file."""
    options, topics = config.options, list(config.topics)
    values = {each.key: _parsed(each) for each in changes if each.input is None}
    if "policy" in values:
        form, policy = file_format(), values["policy"]
        of_policy = tuple(form.topics[policy].model_construct(**dict(topic)) for topic in options.topics)
        options = form.groups[policy].model_construct(**{**dict(options), **values, "topics": of_policy})
    elif values:
        options = options.model_copy(update=values)
    for each in changes:
        if each.input is not None:
            topics[each.input] = replace(topics[each.input], offset_ns=_parsed(each))
    return replace(config, options=options, topics=tuple(topics))


def _parsed(change: Change) -> Any:
    match change.key:
        case "policy":
            return change.value
        case "queue_size":
            return int(change.value)
        case _:
            # A policy's tolerance, whatever its key, `max_wait` or `offset`.
            return parse_duration(change.value)


def _queue(size: int) -> Change:
    return Change("queue_size", str(size))


def _rate(pairs: Arrivals) -> float:
    return (len(pairs) - 1) / max(1, pairs[-1][1] - pairs[0][1]) if pairs else 0.0


def _period(stamps: Sequence[int]) -> float:
    return median(after - before for before, after in pairwise(stamps)) if len(stamps) > 1 else 0.0


def constant_offsets(trials: Trials) -> Iterator[Change]:
    """Yield the offsets that would bring an input's stamps to those of the input that sets the pace.

    Only of an input whose stamps lie a constant distance from its. Where the delays of both say that another message
    than the nearest was made at that time, the distance to that one.
    """
    pivot = trials.pivot
    for index in trials.among:
        if index == pivot:
            continue
        distance = _constant_distance(trials.stamps[pivot], trials.stamps[index])
        if distance is None:
            continue
        later = median(trials.delays[index]) - median(trials.delays[pivot])
        period = _period(sorted(set(trials.stamps[index])))
        whole = round((later + distance) / period) * period
        shift = whole - distance if abs(later + distance - whole) <= _SAME * period else -distance
        # Of two, the one that is farther from this machine's time is odd.
        odd = abs(median(trials.delays[index])) >= abs(median(trials.delays[pivot]))
        at, shift = (index, shift) if odd else (pivot, -shift)
        yield Change("offset", words.exactly(round(trials.config.topics[at].offset_ns + shift)), at)


def _constant_distance(pivots: Sequence[int], stamps: Sequence[int]) -> int | None:
    """Return how far after each pivot the nearest of other stamps is, None where that is not the same for most."""
    signed = signed_distances(pivots, stamps)
    if len(signed) < _FEWEST:
        return None
    middle = signed.quantile(0.5)
    scatter = signed.quantile(0.95) - signed.quantile(0.05)
    return middle if abs(middle) >= _LEAST_DISTANCE and 2 * scatter <= abs(middle) else None
