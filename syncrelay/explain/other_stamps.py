"""Whether other stamps of an input would bring sets: mapped as `clock: device` has it, or the times of receipt."""

from collections.abc import Callable, Collection, Hashable, Iterator
from dataclasses import replace
from typing import Any, Final

import numpy as np

from syncrelay.clock import MOST_RATE, DeviceClock, Step, host_times
from syncrelay.config.units import parse_duration
from syncrelay.explain.changes import Change, Changes, changed
from syncrelay.explain.codes import Code
from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.figures import InputFigures
from syncrelay.explain.findings import written
from syncrelay.explain.nearest import Nanoseconds, period_of, quantile, shifted, sides
from syncrelay.explain.pairing import is_certain
from syncrelay.explain.trials import REQUIRED, UNTRIED, Trials, Tried, Verdict
from syncrelay.explain.widths import with_headroom

# A clock that is set more often, beside a few times at first, is no clock that can be mapped: it has another rate.
_FEW_STEPS: Final = 2
_SET_EVERY: Final = 30_000_000_000
_FEWEST: Final = 5
# What took longer before the clock was set was of another clock then.
_LONGEST_DELAY: Final = 1_000_000_000
# Results may come this late. They can be told from another clock by messages of so much of the time that they take.
_LATENCY: Final = 10_000_000_000
_OLD: Final = 0.5
# Mapped stamps are off by up to this share of the usual jitter.
_ACCURATE: Final = 0.1
# A part of a delay that is less is not worth a key, and no device is known to keep it.
_TENTH_OF_A_MS: Final = 100_000
# Spans near the tolerance are over it when two devices have run a little apart: there may be something better. If
# there is not, so many have to show that hardly any is over it.
_MANY: Final = 20
# What wanders by less is not why sets are missing: a share of the tolerance, and what drivers take.
_MATTERS: Final = 0.5
_LEAST_DISTANCE: Final = 1_000_000
# A drift is too great to be followed if it is that for certain, and goes along a line.
_BENDS: Final = 8


def by_other_stamps(
    trials: Trials,
    index: int,
    target: int | None = REQUIRED,
    *,
    keys: Collection[str] = ("clock", "stamp"),
    delay: int | None = None,
) -> Verdict:
    """Return what mapping an input's stamps gives, or else its times of receipt; nothing of what brings no sets.

    The mapping begins with the messages that it is tried on, and what that costs is counted. The least delay, which it
    cannot know, is the one that was seen before the clock was set, `delay`. Else it is also tried to take off as much
    as the mapped stamps lie behind those of the others; it is open where it decides which messages belong together.
    """
    found: Verdict = _once(trials, (index, target, *keys, delay), lambda: _tried(trials, index, target, keys, delay))
    return found


def _may_be_old(trials: Trials, index: int) -> bool:
    """Whether stamps that seem to be of another clock may be as old as they say, and no message is that old.

    A longer queue cannot be tried then: which of the two it is, nothing shows.
    """
    apart, received = trials.apart(index), [each.received for each in trials.inputs if len(each.received)]
    watched = min((int(each[-1] - each[0]) for each in received), default=0)
    return trials.is_window and _OLD * watched < apart < _LATENCY


def by_offset_of_clock(trials: Trials, index: int, change: Change, target: int | None = REQUIRED) -> Tried | None:
    """Return what an offset for an input of another clock gives; None where nothing shows what belongs together."""
    is_exact = trials.exactly_apart(index) is not None
    is_known = is_exact or (not _may_be_old(trials, index) and is_certain(trials.moved(change), index, target))
    return trials.by_offset(change, target) if is_known else None


def offered_stamps(facts: GroupFacts, code: Code, index: int, *others: int) -> str:
    """Say to have an input's stamps mapped, or to go by receipt, and what that gives; nothing if it does not help.

    With `others`, whose stamps are off too, all are mapped: what is mended of one alone brings no set.
    """
    if facts.suggester is None or not all(_can_be_followed(facts.inputs[each].figures) for each in others):
        return ""
    figures, name = facts.inputs[index].figures, facts.inputs[index].name
    keys = ("clock", "stamp") if _can_be_followed(figures) else ("stamp",)

    def question(trials: Trials) -> Verdict:
        before: Changes = ()
        for other in others:
            mapped = _mapping(trials, other)
            if mapped is None:
                return UNTRIED
            trials, before = mapped, (*before, Change("clock", "device", other))
        verdict = by_other_stamps(trials, index, keys=keys, delay=figures.delay_before)
        return verdict._replace(tried=tuple(replace(each, changes=(*before, *each.changes)) for each in verdict.tried))

    verdict = facts.suggester.ask((code, index, *others, *keys), question, now=facts.figures.now)
    if verdict.is_open:
        return f"; {if_delay_is_known(name)}"
    if not verdict.tried:
        return ""
    (found,) = verdict.tried
    return (
        f", or write {written(facts, found.changes)}, which would give {found.given} of {found.possible} possible sets"
    )


def if_delay_is_known(name: str) -> str:
    """Say what to do about an input whose least delay decides what its messages match."""
    return (
        f"if you know how long messages of {name} take at least to arrive, which decides what they match, map its"
        " stamps with the keys `clock` and `delay`"
    )


def wandering(trials: Trials, index: int) -> int:
    """Return how far an input's clock went off the host's time, in nanoseconds; 0 of less than can matter."""
    tolerance, messages = trials.config.options.tolerance, trials.inputs[index]
    mapped = None if tolerance is None else _mapped(trials, index)
    if tolerance is None or mapped is None or not messages.are_stamped.any():
        return 0
    is_set = messages.are_stamped
    wandered = _spread(mapped[is_set] - messages.stamps[:][is_set])
    # What wanders by less than messages are late by may have come of that.
    jitter = _spread(messages.received[:][is_set] - mapped[is_set])
    return wandered if wandered >= max(_LEAST_DISTANCE, _MATTERS * tolerance.ns, jitter) else 0


def _spread(values: Nanoseconds) -> int:
    near = shifted(values, 0)
    return quantile(near, 0.95) - quantile(near, 0.05)


def _can_be_followed(figures: InputFigures) -> bool:
    """Whether no rate is evident that the mapping does not follow. What bends is a clock that was set."""
    if figures.reading is not None and not figures.reading.is_unit:
        return False
    drift = figures.drift
    is_line = drift is not None and abs(drift.drifted_ns) >= _BENDS * drift.bend_ns
    return not is_line or drift is None or abs(drift.slope) <= max(MOST_RATE, drift.doubt)


def _tried(trials: Trials, index: int, target: int | None, keys: Collection[str], delay: int | None) -> Verdict:
    config = trials.config
    topic, tolerance = config.topics[index], config.options.tolerance
    needs_equal = tolerance is not None and not tolerance.takes_times_of_arrival
    if topic.is_of_device or topic.stamp == "receive" or needs_equal:
        return UNTRIED
    # What runs at another rate is of another clock.
    if "clock" in keys and _may_be_old(trials, index):
        return UNTRIED
    narrow, is_open = None, False
    for moved, changes, is_known in _attempts(trials, index, target, keys, delay):
        if narrow is not None and changes[0].key == "stamp":
            break
        if not moved.is_enough((), target) or (changes[0].key == "clock" and _is_rough(moved, index)):
            continue
        if not is_known and not is_certain(moved, index, target):
            is_open |= changes[0].key == "clock"
            continue
        tried = Tried(changes, moved.given((), target), trials.given((), target), len(moved.spans(target)))
        if is_known or tolerance is None or parse_duration(with_headroom(moved.spans(target))) <= tolerance.ns:
            return Verdict((tried,))
        narrow = narrow or (tried if len(moved.spans(target)) >= _MANY else None)
    return Verdict((narrow,)) if narrow else Verdict((), is_open=is_open)


def _mapping(trials: Trials, index: int) -> Trials | None:
    """Return trials of the same messages with an input's stamps mapped; None where they cannot be."""
    topic = trials.config.topics[index]
    mapped = None if topic.is_of_device or topic.stamp == "receive" else _mapped(trials, index)
    if mapped is None or trials.config.inputs.node.use_sim_time:
        return None
    return _with_stamps(trials, index, mapped, (Change("clock", "device", index),))


def _attempts(
    trials: Trials, index: int, target: int | None, keys: Collection[str], delay: int | None
) -> Iterator[tuple[Trials, Changes, bool]]:
    """Yield trials with other stamps of an input's messages, what to write for them, and if the delay is known."""
    if "clock" in keys and (at_once := _mapping(trials, index)) is not None:
        device: Changes = (Change("clock", "device", index),)
        mapped = at_once.inputs[index].stamps[:]
        known = [] if delay is None or not 0 <= delay < _LONGEST_DELAY else [_in_tenths(delay)]
        late = [(each, True) for each in known] or [
            (0, False),
            *((each, False) for each in _lateness(at_once, index, target)),
        ]
        for by, is_known in late:
            changes = (*device, Change("delay", f"{by / 1_000_000:g}ms", index)) if by else device
            yield (
                _with_stamps(trials, index, mapped - by * at_once.inputs[index].are_stamped, changes),
                changes,
                is_known,
            )
    if "stamp" in keys:
        by_receipt: Changes = (Change("stamp", "receive", index),)
        yield _with_stamps(trials, index, trials.inputs[index].received[:], by_receipt), by_receipt, False


def _in_tenths(delay: int) -> int:
    return delay // _TENTH_OF_A_MS * _TENTH_OF_A_MS


def _is_rough(mapped: Trials, index: int) -> bool:
    """Whether messages are late by so much more than the tolerance that their mapped stamps are no nearer than that."""
    tolerance, messages = mapped.config.options.tolerance, mapped.inputs[index]
    is_set = messages.are_stamped
    if tolerance is None or not is_set.any():
        return False
    delays = messages.received[:][is_set] - messages.stamps[:][is_set]
    return bool(_ACCURATE * (np.mean(delays) - np.min(delays)) > tolerance.ns)


def _once(trials: Trials, about: Hashable, find: Callable[[], Any]) -> Any:
    """Return what is found, or was found before."""
    if about not in trials.kept:
        trials.kept[about] = find()
    return trials.kept[about]


def _mapped(trials: Trials, index: int) -> Nanoseconds | None:
    """Return what _mapped_stamps does, found once."""
    found: Nanoseconds | None = _once(trials, index, lambda: _mapped_stamps(trials, index))
    return found


def _mapped_stamps(trials: Trials, index: int) -> Nanoseconds | None:
    """Return an input's stamps as they would be mapped; None of a clock that would be taken as set time and again."""
    steps: list[Step] = []
    clock, messages = DeviceClock(stepped=steps.append), trials.inputs[index]
    received = messages.received[:].tolist()
    mapped = np.fromiter(host_times(clock, messages.stamps[:].tolist(), received), dtype=np.int64)
    if not received or len(steps) > _FEW_STEPS + (received[-1] - received[0]) // _SET_EVERY:
        return None
    return mapped


def _with_stamps(trials: Trials, index: int, stamps: Nanoseconds, changes: Changes) -> Trials:
    """Return trials of the same messages with other stamps of an input, of the group with changes."""
    own = replace(trials.inputs[index], stamps=stamps, ordered={})
    inputs = [own if at == index else each for at, each in enumerate(trials.inputs)]

    # As in a window: what the mapping costs until it has settled is not held against it.
    return replace(
        trials,
        config=changed(trials.config, changes),
        inputs=inputs,
        is_window=True,
        sets=None,
        kept={},
        _targets={},
        _runs={},
    )


def _lateness(moved: Trials, index: int, target: int | None) -> Iterator[int]:
    """Yield by how much mapped stamps lie behind those before them that are nearest, where that is a constant."""
    possible = moved.possible(target)
    if possible is None or len(possible.among) < 2:  # noqa: PLR2004  one alone is beside nothing
        return
    other = possible.pivot if possible.pivot != index else next(each for each in possible.among if each != index)
    own, others = moved.stamps(index), moved.stamps(other)
    is_pivot = possible.pivot == index
    late = sides(own[:], others[:]).before if is_pivot else sides(others[:], own[:]).after
    # What the mapping did at first, before it had settled, tells nothing.
    late = late[len(late) // 2 :]
    if len(late) < _FEWEST:
        return
    usual = _in_tenths(quantile(late, 0.5))
    # Stamps that are little before the nearest are not late by nearly a period.
    is_early = 2 * usual > period_of(others if is_pivot else own) and moved.is_enough((), target)
    if usual and not is_early and 2 * (quantile(late, 0.9) - quantile(late, 0.1)) <= usual:
        yield usual
