"""Values that fit what was recorded: measured, then tried on the recording with the engine itself."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil
from statistics import median
from typing import Final

import numpy as np

from syncrelay.config import GroupConfig
from syncrelay.config.wording import all_of
from syncrelay.explain import words
from syncrelay.recordings.analysis.changes import Change
from syncrelay.recordings.analysis.curves import LARGEST_QUEUE
from syncrelay.recordings.analysis.evaluation import Evaluation, completed, evaluate
from syncrelay.recordings.analysis.nearest import Pair, PossibleSets, pair, tightest
from syncrelay.recordings.analysis.streams import Stream
from syncrelay.recordings.analysis.topics import TopicFigures, figures_of

_US: Final = 1_000
_MS: Final = 1_000_000
_SECOND: Final = 1_000_000_000
ENOUGH: Final = 0.99
"""The share of the possible sets that good values give."""
# Stamps are meant to be equal where so many are; what is not equal then has lost its partner.
_EQUAL: Final = 0.8
# Farther away than so many periods of the input, a partner is not the one that was meant: it is missing.
_PERIODS: Final = 1.5
_FAR_OFF: Final = 4
# A slop so many times what is needed lets wrong messages in where the right ones are missing.
_TOO_WIDE: Final = 4
_SAME_SPAN: Final = 1.02
_UNSET: Final = 0.5


@dataclass(frozen=True, slots=True)
class Suggestion:
    """Changes to a group and what they would give; no changes where its values do, or cannot be measured.

    `possible` is how many sets there could be, `now` and `then` how many there are, before thinning. `hints` are
    sentences on what only its owner can know of a rig.
    """

    changes: tuple[Change, ...]
    hints: tuple[str, ...]
    possible: int
    now: int
    then: int


def suggest(
    group: GroupConfig,
    streams: Sequence[Stream],
    evaluation: Evaluation,
    changed: Callable[[Sequence[Change]], GroupConfig],
) -> Suggestion:
    """Return better values for a group; `changed` gives the group with changes made."""
    if group.options.matched_by:
        return Suggestion((), (_not_measured(group.options.matched_by),), 0, 0, 0)
    stamping = list(_stamping(group, streams))
    found = _suggested(streams, evaluation, changed, stamping)
    # What comes seconds late looks like a clock that is off.
    return _suggested(streams, evaluation, changed, []) if stamping and found.then < found.now else found


def _suggested(
    streams: Sequence[Stream],
    evaluation: Evaluation,
    changed: Callable[[Sequence[Change]], GroupConfig],
    stamping: Sequence[Change],
) -> Suggestion:
    base = changed(stamping)
    streams = stamped(base, streams)
    possible = possible_sets(base, streams)
    if possible is None:
        missing = [stream.topic for stream in streams if not stream.stamps]
        return Suggestion((), (f"no values to suggest: no messages of {', '.join(missing)}",), 0, 0, 0)
    hints = tuple(_hints(base, streams))
    most = len(possible.spans)
    now = completed(evaluation.counts, possible.tightest.pivot)
    changes, best = [*stamping], evaluate(base, streams) if stamping else evaluation
    if not _does(base, best, possible):
        for more in _ladder(base, possible):
            # What was measured takes the place of what stood until then.
            both = list({(each.topic, each.key): each for each in (*stamping, *more)}.values())
            attempt = evaluate(changed(both), streams)
            reached = completed(attempt.counts, possible.tightest.pivot)
            if reached >= ENOUGH * most or reached > completed(best.counts, possible.tightest.pivot):
                changes, best = both, attempt
            if reached >= ENOUGH * most:
                break
    sooner = [*changes, *_periods(changed(changes), streams)]
    if len(sooner) > len(changes):
        quick = evaluate(changed(sooner), streams)
        if _is_sooner(quick, best):
            reason = f"sets leave {words.duration(_latency(best) - _latency(quick))} sooner"
            changes = [replace(each, reason=reason) if each.key == "min_period" else each for each in sooner]
            best = quick
    then = completed(best.counts, possible.tightest.pivot)
    # A policy may find sets that are wider than the tightest of a message.
    return Suggestion(tuple(changes), hints, max(most, now, then), now, then)


def _not_measured(keys: Sequence[str]) -> str:
    deciding = f"{all_of(f'`{key}`' for key in keys)} {'decide' if len(keys) > 1 else 'decides'}"
    return f"no values to suggest: {deciding} which messages belong together"


def possible_sets(group: GroupConfig, streams: Sequence[Stream]) -> PossibleSets | None:
    """Return what sets a recording holds for the required inputs.

    None where one of them has no stamps, and for a policy by which messages need not be near to belong together.
    """
    if group.options.matched_by:
        return None
    required = [index for index, topic in enumerate(group.topics) if topic.required]
    chosen, offsets = [streams[index] for index in required], [group.topics[index].offset_ns for index in required]
    # The best match is certain only when what comes next is there, unless it may not wait so long.
    waits = group.options.waits_for_next and group.options.max_wait is None
    pivot = None if group.trigger is None else required.index(group.trigger)
    found = tightest(chosen, offsets, pivot=pivot, successors=int(waits))
    if found is None:
        return None
    found = replace(found, pivot=required[found.pivot])
    is_alone = len(required) == 1
    if found.share_within(0) >= _EQUAL:
        spans = (0,) * int(np.count_nonzero(found.spans == 0))
        return PossibleSets(found, is_exact=not is_alone, is_alone=is_alone, spans=spans)
    periods = [figures_of(streams[index]).period or 0 for index in required if index != found.pivot]
    # Where most lie close together, what lies far off has lost its partner.
    usual = int(np.quantile(found.spans, 0.75, method="inverted_cdf"))
    limit = min(_PERIODS * max(periods), _FAR_OFF * usual)
    within = found.spans[(found.disjoint | group.options.repeats) & (found.spans <= limit)]
    return PossibleSets(found, is_exact=False, is_alone=False, spans=tuple(np.sort(within).tolist()))


def _stamping(group: GroupConfig, streams: Sequence[Stream]) -> Iterator[Change]:
    """Go by arrival where stamps are unset, and bring together clocks that are far apart."""
    figures = [figures_of(stream) for stream in streams]
    unset = [each for each in figures if each.messages and each.unstamped > _UNSET * each.messages]
    if unset:
        reason = f"{unset[0].unstamped} of {unset[0].messages} messages of {unset[0].topic} have stamp 0"
        yield from _by_arrival(group, reason)
        return
    delays = {index: each.delay.median for index, each in enumerate(figures) if each.delay is not None}
    usual = sorted(delays.values(), key=abs)[0 if len(delays) <= 2 else (len(delays) - 1) // 2] if delays else 0  # noqa: PLR2004
    for index, delay in delays.items():
        if abs(delay - usual) > _SECOND and not group.topics[index].offset_ns:
            reason = f"its stamps are {words.duration(abs(delay - usual))} off the others'"
            yield Change(group.name, index, "offset", words.exactly(delay - usual), reason)


def _by_arrival(group: GroupConfig, reason: str) -> Iterator[Change]:
    """Go by arrival, with a tolerance, which stands until a better one is measured."""
    tolerance = group.options.tolerance
    if tolerance is not None and not tolerance.takes_times_of_arrival:
        yield from _policy(group, tolerance.wider_policy or group.options.policy, reason)
        yield Change(group.name, None, tolerance.key, "10ms", reason)
    for index, topic in enumerate(group.topics):
        if topic.stamp != "receive":
            yield Change(group.name, index, "stamp", "receive", reason)


def stamped(group: GroupConfig, streams: Sequence[Stream]) -> list[Stream]:
    """Return the streams with times of receipt in place of stamps where the group goes by them."""
    return [
        stream.by_receipt() if topic.stamp == "receive" else stream
        for topic, stream in zip(group.topics, streams, strict=True)
    ]


def _does(group: GroupConfig, evaluation: Evaluation, possible: PossibleSets) -> bool:
    """Tell whether a group's values give enough, and no slop is far wider than what is needed."""
    if completed(evaluation.counts, possible.tightest.pivot) < ENOUGH * len(possible.spans):
        return False
    slop = group.options.tolerance.ns if group.options.tolerance else 0
    return bool(possible.is_alone or (possible.is_exact and not slop)) or (
        not possible.is_exact and bool(possible.spans) and slop <= _TOO_WIDE * possible.spans[-1]
    )


def _ladder(group: GroupConfig, possible: PossibleSets) -> Iterator[list[Change]]:
    """Yield values, the tightest first."""
    if possible.is_exact or possible.is_alone:
        are_stamps = all(topic.stamp != "receive" for topic in group.topics)
        is_exact = possible.is_exact and are_stamps
        exact = _policy(group, "exact_time", "the stamps of a set are equal") if is_exact else []
        yield from ([*exact, *queue] for queue in _queues(group, possible, 0))
        return
    spans, tolerance = possible.spans, group.options.tolerance
    if not spans or tolerance is None:
        return
    policy = tolerance.wider_policy or group.options.policy
    for slop in dict.fromkeys((spans[ceil(0.995 * len(spans)) - 1], spans[-1])):
        text = words.at_least(slop)
        reason = f"the nearest messages lie {words.duration(median(spans))} apart, at most {words.duration(slop)}"
        if slop < tolerance.ns:
            reason += f"; a wider {tolerance.key} only lets in worse sets"
        for queue in _queues(group, possible, slop):
            yield [
                *_policy(group, policy, "the stamps of a set differ"),
                Change(group.name, None, tolerance.key, text, reason),
                *queue,
            ]


def _policy(group: GroupConfig, policy: str, reason: str) -> list[Change]:
    return [] if group.options.policy == policy else [Change(group.name, None, "policy", policy, reason)]


def _queues(group: GroupConfig, possible: PossibleSets, slop: int) -> Iterator[list[Change]]:
    """Yield larger and larger queues, first the one that there is."""
    yield []
    found = possible.tightest
    queues = found.queues[found.spans <= slop]
    need = int(np.quantile(queues, 0.995, method="inverted_cdf")) if len(queues) else 1
    size = need + ceil(need / 4) + 1
    while size <= 4 * max(need, group.options.queue_size) and size <= LARGEST_QUEUE:
        if size > group.options.queue_size:
            reason = f"up to {need} messages of one input arrive before its set is complete"
            yield [Change(group.name, None, "queue_size", size, reason)]
        size *= 2


def _periods(group: GroupConfig, streams: Sequence[Stream]) -> Iterator[Change]:
    """Tell the policy that can use it the least time between messages, where a topic keeps one."""
    if not group.options.waits_for_next:
        return
    for index, (topic, stream) in enumerate(zip(group.topics, streams, strict=True)):
        figures = figures_of(stream)
        bound = _lower_bound(figures)
        if bound and not topic.min_period_ns:
            yield Change(group.name, index, "min_period", bound, "")


def _lower_bound(figures: TopicFigures) -> str | None:
    """Return nine tenths of the least period, in whole units that people write."""
    least, usual = figures.least_period, figures.period
    if not least or not usual or 2 * least < usual or figures.out_of_order:
        return None
    bound = least * 9 // 10
    if bound >= 10 * _MS:
        return f"{bound // _MS}ms"
    return f"{bound // _US}us" if bound >= _US else None


def _is_sooner(quick: Evaluation, slow: Evaluation) -> bool:
    if len(quick.sets) < len(slow.sets) or not slow.sets:
        return False
    spans = [median(each.span for each in evaluation.sets) for evaluation in (quick, slow)]
    gain = _latency(slow) - _latency(quick)
    # The last sets, which only one of the two has, move the median a little.
    return spans[0] <= _SAME_SPAN * spans[1] and gain >= max(_MS, _latency(slow) / 10)


def _latency(evaluation: Evaluation) -> float:
    return median(each.latency for each in evaluation.sets)


def _hints(group: GroupConfig, streams: Sequence[Stream]) -> Iterator[str]:
    """Yield which inputs are stamped a constant time apart."""
    for first in range(len(streams)):
        for second in range(first + 1, len(streams)):
            offsets = (group.topics[first].offset_ns, group.topics[second].offset_ns)
            found = pair(streams[first], streams[second], offsets)
            if found is not None and _is_constant(found, streams):
                apart, scatter = found.signed.median, found.signed.high - found.signed.low
                about = f", give or take {words.duration(scatter / 2)}" if scatter else ""
                yield (
                    f"{found.second} is stamped {words.duration(abs(apart))} {'after' if apart > 0 else 'before'}"
                    f" {found.first}{about}: if one trigger starts both, write `offset: {words.exactly(-apart)}` at"
                    f" {found.second}"
                )


def _is_constant(found: Pair, streams: Sequence[Stream]) -> bool:
    period = min(figures_of(stream).period or 0 for stream in streams if stream.topic in (found.first, found.second))
    middle, scatter = abs(found.signed.median), found.signed.high - found.signed.low
    return middle >= _MS and scatter <= middle / 2 and middle < 0.4 * period
