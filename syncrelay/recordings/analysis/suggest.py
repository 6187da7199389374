"""The suggester's values for a recording, as changes to a file with their reasons; and what no trial can find."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from syncrelay.config import GroupConfig
from syncrelay.config.units import parse_duration
from syncrelay.config.wording import all_of
from syncrelay.explain import words
from syncrelay.explain.changes import Change as TriedChange
from syncrelay.explain.changes import Changes
from syncrelay.explain.epochs import BOOT_NS
from syncrelay.explain.nearest import quantile
from syncrelay.explain.other_stamps import by_offset_of_clock, by_other_stamps, if_delay_is_known, wandering
from syncrelay.explain.rows import Column, blocks, median
from syncrelay.explain.rules_transforms import enough_wait
from syncrelay.explain.trials import Trials
from syncrelay.recordings.analysis.changes import Change
from syncrelay.recordings.analysis.evaluation import Evaluation, evaluate
from syncrelay.recordings.analysis.streams import Stream, stamped
from syncrelay.recordings.analysis.topics import TopicFigures, figures_of

_US: Final = 1_000
_MS: Final = 1_000_000
_SECOND: Final = 1_000_000_000
# Two evaluations have the same spans within this factor.
_SAME_SPAN: Final = 1.02
_UNSET: Final = 0.5
# Of several ways, the one that changes least is taken, if it gives such a share of the sets.
_AS_MANY: Final = 0.95


@dataclass(frozen=True, slots=True)
class Suggestion:
    """Changes to a group and what they would give; no changes where its values do, or cannot be measured.

    `possible` is how many sets of one moment there could be, `now` and `then` how many come together, before thinning.
    `hints` are sentences on what only its owner can know of a rig.
    """

    changes: tuple[Change, ...]
    hints: tuple[str, ...]
    possible: int
    now: int
    then: int


def trials_of(group: GroupConfig, streams: Sequence[Stream], evaluation: Evaluation | None = None) -> Trials:
    """Return trials of a group on a whole recording, of which there may be an evaluation already."""
    # Trials thin nothing, wait for no transforms, and go by ticks, which an evaluation does not keep.
    options = group.options
    is_alike = options.every == 1 and not options.max_rate and options.transforms is None and group.ticks is None
    sets = evaluation.sets.rows.blocks if evaluation is not None and is_alike else None
    return Trials(group, [each.as_received() for each in streams], is_window=False, sets=sets)


def suggest(
    group: GroupConfig,
    streams: Sequence[Stream],
    trials: Trials,
    evaluation: Evaluation,
    changed: Callable[[Sequence[Change]], GroupConfig],
) -> Suggestion:
    """Return better values for a group; `changed` gives the group with changes made, `trials` are those without."""
    found = _matching(group, streams, trials, evaluation, changed)
    transforms = group.options.transforms
    if transforms is None:
        return found

    def evaluated(changes: Sequence[Change]) -> Evaluation:
        with_them = changed(changes)
        return evaluate(with_them, stamped(with_them, streams))

    now = evaluated(found.changes) if found.changes else evaluation
    wait = enough_wait(now.lapses)
    if wait is None or parse_duration(wait) <= transforms.wait:
        return found
    longer = Change(group.name, None, "transforms.wait", wait, "transforms lag behind the messages by nearly that")
    changes = (*found.changes, longer)
    return replace(found, changes=changes) if len(evaluated(changes).sets) > len(now.sets) else found


def _matching(
    group: GroupConfig,
    streams: Sequence[Stream],
    trials: Trials,
    evaluation: Evaluation,
    changed: Callable[[Sequence[Change]], GroupConfig],
) -> Suggestion:
    """Return better values for what is matched."""
    if keys := group.options.matched_by:
        deciding = f"{all_of(f'`{key}`' for key in keys)} {'decide' if len(keys) > 1 else 'decides'}"
        return Suggestion((), (f"no values to suggest: {deciding} which messages belong together",), 0, 0, 0)
    restamped = []
    for stamping in _stampings(group, streams, trials):
        base = changed(stamping)
        by_base = trials_of(base, stamped(base, streams))
        now = min(len(by_base.spans()), len(evaluation.sets))
        restamped.append(_suggested(by_base, stamped(base, streams), evaluation, changed, stamping, now=now))
    most = max((each.then for each in restamped), default=0)
    # What comes seconds late looks like a clock that is off.
    if most > trials.given(()):
        return next(each for each in restamped if each.then >= _AS_MANY * most)
    return _suggested(trials, streams, evaluation, changed, [], now=trials.given(()))


def _suggested(
    trials: Trials,
    streams: Sequence[Stream],
    evaluation: Evaluation,
    changed: Callable[[Sequence[Change]], GroupConfig],
    stamping: Sequence[Change],
    *,
    now: int,
) -> Suggestion:
    possible = trials.possible()
    if possible is None:
        missing = [stream.topic for stream in streams if not len(stream.stamps)]
        return Suggestion((), (f"no values to suggest: no messages of {', '.join(missing)}",), 0, 0, 0)
    # What was measured takes the place of what stood until then.
    planned, then = [_as_change(each, trials) for each in trials.plan], trials.given(trials.plan)
    changes = list({(each.topic, each.key): each for each in (*stamping, *planned)}.values())
    if sooner := list(_periods(changed(changes), streams)):
        slow = evaluate(changed(changes), streams) if changes else evaluation
        quick = evaluate(changed([*changes, *sooner]), streams)
        if _is_sooner(quick, slow):
            reason = f"sets leave {words.duration(_latency(slow) - _latency(quick))} sooner"
            changes += [replace(each, reason=reason) for each in sooner]
            then = max(then, trials_of(changed(changes), streams).given(()))
    hints = (
        *(_hint(trials.config, possible.pivot, each) for each in trials.offsets()),
        *(if_delay_is_known(each.topic) for at, each in enumerate(trials.config.topics) if _is_open(trials, at)),
    )
    return Suggestion(tuple(changes), hints, len(possible), now, then)


def _as_change(change: TriedChange, trials: Trials) -> Change:
    """Return a value of the plan as a change to the file, and why."""
    config, value = trials.config, change.value
    spans, tolerance = trials.spans(), config.options.tolerance
    if change.key == "queue_size":
        possible = trials.possible()
        need = quantile(possible.queues, 0.995) if possible is not None and len(possible) else 1
        reason = f"up to {need} messages of one input arrive before its set is complete"
        return Change(config.name, change.input, change.key, int(value), reason)
    if change.key == "policy":
        reason = f"the stamps of a set {'are equal' if value == 'exact_time' else 'differ'}"
        if value == config.options.patient_policy:
            reason = "it waits for messages that come late"
    elif tolerance is not None and change.key == tolerance.key:
        widest = max(each.widest for each in map(trials.possible, (None, *trials.optional)) if each is not None)
        apart = words.duration(quantile(spans, 0.5)) if len(spans) else "far"
        reason = f"the nearest messages lie {apart} apart, at most {words.duration(widest)}"
        if trials.is_enough(()):
            reason += f"; a wider {tolerance.key} only lets in worse sets"
    else:
        reason = "optional messages come that much later" if trials.optional else "sets are complete that much later"
    return Change(config.name, change.input, change.key, value, reason)


def _stampings(group: GroupConfig, streams: Sequence[Stream], trials: Trials) -> list[list[Change]]:
    """Return ways to go by other stamps: where some are unset, by arrival there, or at all inputs."""
    figures = [figures_of(stream) for stream in streams]
    unset = {n: each for n, each in enumerate(figures) if each.messages and each.unstamped > _UNSET * each.messages}
    if unset:
        first = next(iter(unset.values()))
        reason = f"{first.unstamped} of {first.messages} messages of {first.topic} have stamp 0"
        return [[*_by_arrival(group, inputs, reason)] for inputs in (unset, range(len(figures)))]
    return [each for each in [[*_of_one_clock(group, trials)]] if each]


def _of_one_clock(group: GroupConfig, trials: Trials) -> Iterator[Change]:
    """Bring together clocks that are far apart."""
    for index, topic in enumerate(group.topics):
        apart, reason = abs(trials.apart(index)), ""
        offset = None if topic.offset_ns else trials.clock_offset(index)
        is_off = offset is not None and apart > _SECOND
        if is_off:
            reason = f"its stamps are {words.duration(apart)} off the others'"
        elif not trials.is_enough(()) and (wandered := wandering(trials, index)):
            reason = f"its clock went {words.duration(wandered)} off the host's time in the recording"
        if not reason:
            continue
        changes: Changes = (offset,) if offset is not None and is_off else ()
        # What counts from boot has another offset after the next.
        is_constant = apart <= BOOT_NS or trials.exactly_apart(index) is not None
        if not (is_constant and any(by_offset_of_clock(trials, index, each) for each in changes)):
            verdict = by_other_stamps(trials, index, keys=["clock"])
            if verdict.is_open:
                continue
            changes = verdict.tried[0].changes if verdict.tried else changes
        for each in changes:
            why = "mapped stamps are later than the others' by that" if each.key == "delay" else reason
            yield Change(group.name, index, each.key, each.value, why)


def _is_open(trials: Trials, index: int) -> bool:
    """Whether an input would be mapped, but its least delay decides what its messages match."""
    is_off = abs(trials.apart(index)) > _SECOND or (not trials.is_enough(()) and wandering(trials, index))
    return bool(is_off) and by_other_stamps(trials, index, keys=["clock"]).is_open


def _by_arrival(group: GroupConfig, inputs: Collection[int], reason: str) -> Iterator[Change]:
    """Go by arrival at some inputs, with a tolerance, which stands until a better one is measured."""
    tolerance = group.options.tolerance
    if tolerance is not None and not tolerance.takes_times_of_arrival:
        if tolerance.wider_policy:
            yield Change(group.name, None, "policy", tolerance.wider_policy, reason)
        yield Change(group.name, None, tolerance.key, "10ms", reason)
    for index, topic in enumerate(group.topics):
        if index in inputs and topic.stamp != "receive":
            yield Change(group.name, index, "stamp", "receive", reason)


def _periods(group: GroupConfig, streams: Sequence[Stream]) -> Iterator[Change]:
    """Tell the policy that can use it the least time between messages, where a topic keeps one."""
    if not group.options.waits_for_next:
        return
    for index, (topic, stream) in enumerate(zip(group.topics, streams, strict=True)):
        bound = _lower_bound(figures_of(stream))
        # Mapped stamps keep no period.
        if bound and not topic.min_period_ns and not topic.is_of_device:
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
    spans = [_median(evaluation.sets.spans) for evaluation in (quick, slow)]
    gain = _latency(slow) - _latency(quick)
    # The last sets, which only one of the two has, move the median a little.
    return spans[0] <= _SAME_SPAN * spans[1] and gain >= max(_MS, _latency(slow) / 10)


def _latency(evaluation: Evaluation) -> float:
    return _median(evaluation.sets.latencies)


def _median(values: Column) -> float:
    return median(lambda: blocks(values))


def _hint(group: GroupConfig, pivot: int, offset: TriedChange) -> str:
    at = offset.input or 0
    topic, by = group.topics[at].topic, parse_duration(offset.value) - group.topics[at].offset_ns
    other = pivot if at != pivot else next(index for index in range(len(group.topics)) if index != pivot)
    return (
        f"{topic} is stamped {words.duration(abs(by))} {'before' if by > 0 else 'after'} {group.topics[other].topic}:"
        f" if one trigger starts both, write `offset: {offset.value}` at {topic}"
    )
