"""Findings about stamps: unset, of another clock, falling, drifting."""

from collections.abc import Iterable
from typing import Final

from syncrelay.clock import Step
from syncrelay.config.units import parse_duration
from syncrelay.config.wording import all_of
from syncrelay.explain import words
from syncrelay.explain.changes import offset_change
from syncrelay.explain.codes import Code, Severity
from syncrelay.explain.distribution import Distribution
from syncrelay.explain.epochs import TimeScale, time_scale, usual_delay
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.figures import InputFigures
from syncrelay.explain.findings import SECOND, Fault, Found, blocks, counted, nodes, written
from syncrelay.explain.order import WINDOW_NS
from syncrelay.explain.other_stamps import by_offset_of_clock, offered_stamps
from syncrelay.explain.rules_flow import waited_for_relay
from syncrelay.explain.standing import Standing
from syncrelay.explain.steps import STEP_NS
from syncrelay.explain.trials import REQUIRED, UNTRIED, Trials, Verdict
from syncrelay.sync.messages import DropReason

# Stamps further off than this come from another clock, or are older than a queue should hold.
_OTHER_CLOCK: Final = SECOND
_TOLD_JUMP: Final = 30 * SECOND
# What was held up tells nothing of a clock: of the delays, this quantile does.
_LEAST_DELAY: Final = 0.1
# One message in a hundred with a repeated or late stamp is not worth a finding.
_FAULTY: Final = 0.01
_SOME: Final = 0.02
_MOST: Final = 0.5
# No clock that is kept is so far off.
_AHEAD: Final = SECOND // 2
# A computation may take this long. Older stamps come from another clock.
_LATENCY: Final = 10 * SECOND
# Stamps that step there and back this often come from two clocks.
_FEWEST_SWINGS: Final = 2
# Recordings are longer.
_LOOPED: Final = 10 * SECOND
# Steps of inputs that differ by less than this share are one.
_STEPPED_ALIKE: Final = 0.25
# A step of less than this share of the tolerance costs no sets.
_MATTERS: Final = 0.5
# Two ways to measure one offset agree within this share of it.
_SAME_OFFSET: Final = 0.1
# Stamps of inputs that run this much alike are of one clock.
_SAME_RATE: Final = 0.05
# Sets are looked for about once a second. They have ceased to leave when so many are missing.
_LOOK: Final = round(1.1 * SECOND)
_FEW_SETS: Final = 3
_SLEW: Final = "check what set the clock {where}; NTP and chrony can be told to slew it instead"


def malformed(facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find messages whose stamp or key could not be read."""
    if count := an_input.figures.dropped.get(DropReason.MALFORMED, 0):
        # A key may stand anywhere in a message.
        what = "or not of its type" if facts.by_stamp else "not of its type, or have too many values before the key"
        yield Fault(
            f"{counted(count, an_input.figures.fed)} messages of {an_input.name} are cut short, {what}",
            f"check that {nodes(an_input)} uses the same version of {an_input.type} as is installed here",
            _blocks_if_most(facts, an_input, count),
            explains=_matters(facts, an_input, count),
        )


def unstamped(facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find messages whose stamp was never set."""
    if count := an_input.figures.dropped.get(DropReason.UNSTAMPED, 0):
        yield Fault(
            f"{counted(count, an_input.figures.fed)} messages of {an_input.name} have stamp 0",
            f"have {nodes(an_input)} set header.stamp{_or_by_arrival(facts, an_input)}",
            _blocks_if_most(facts, an_input, count),
            explains=_matters(facts, an_input, count),
        )


def _or_by_arrival(facts: GroupFacts, an_input: InputFacts) -> str:
    """Offer times of arrival in place of stamps; not where the stamps of a set have to be equal."""
    if facts.tolerance is not None and not facts.tolerance.takes_times_of_arrival:
        return ""
    return f", or write `stamp: receive` at {an_input.name}"


def _matters(facts: GroupFacts, an_input: InputFacts, count: int) -> bool:
    """Return whether so many messages of no use may explain others: most explain a silence, some explain losses."""
    return count >= (_MOST if facts.is_silent else _SOME) * an_input.figures.fed


def _blocks_if_most(facts: GroupFacts, an_input: InputFacts, count: int) -> Severity:
    """Return how bad it is that so many messages are of no use: a few don't explain a silence."""
    return blocks(facts, an_input) if 2 * count >= an_input.figures.fed else Severity.WARN


def other_clock(facts: GroupFacts) -> Found:
    """Find an input whose stamps, against the time of their receipt, are of another unit, rate or time."""
    if not facts.by_stamp or facts.is_new:
        return
    misread = list(_misread(facts))
    yield from misread
    last = [delay - each.offset for each in facts.inputs for delay in each.figures.delays[-1:]]
    # Nothing is stamped ahead of its time, but simulated time is told late itself.
    is_ahead = facts.clock is None and min(last, default=0) < -_AHEAD
    if misread or facts.ticks_hz is not None or not (facts.has_stopped or is_ahead):
        return
    # Two messages show whether their stamps run as time does.
    delays = {
        index: _least_delay(each.figures)
        for index, each in enumerate(facts.inputs)
        if each.required and (each.figures.rate_hz or len(each.figures.received) == 1) and len(each.figures.delays) > 1
    }
    known = {index: delay - facts.inputs[index].offset for index, delay in delays.items()}
    if len(known) < 2:  # noqa: PLR2004  one alone has no other clock
        return
    usual = usual_delay(known.values())
    # What waited for the relay seems as late as that.
    least = _OTHER_CLOCK if facts.has_stopped else _AHEAD
    limit = max(least, facts.tolerance.ns if facts.tolerance else 0, 2 * max(waited_for_relay(facts)))
    off = {index: behind for index, delay in known.items() if abs(behind := delay - usual) > limit}
    if not facts.has_stopped:
        # What is behind may be a result that takes so long.
        off = {index: behind for index, behind in off.items() if known[index] < -_AHEAD}
    usually = [facts.inputs[index].name for index in known if index not in off]
    whose = "the other inputs" if len(off) == 1 < len(usually) else all_of(usually)
    # The farthest first; of those of one clock, whose delays differ by less than a second, the first of the file.
    for index, behind in sorted(off.items(), key=lambda each: -abs(each[1]) // SECOND):
        an_input, offset = facts.inputs[index], facts.inputs[index].offset
        shifted = f", with its offset of {words.exactly(offset)}," if offset else ""
        newest = an_input.figures.stamps[-1] if an_input.figures.stamps else 0
        scale = time_scale(newest, behind)
        text = (
            f"stamps of {an_input.name}{shifted} are {words.behind(behind)} those of {whose}"
            f"{f': they {scale.what}' if scale else ''}"
        )
        text += "" if facts.has_stopped else ": any set of these holds messages of different moments"
        by = behind if scale is None else scale.behind
        mapped = _or_mapped(facts, index, None if by is None else by + offset)
        right = _to_the_usual_time(facts, an_input, scale)
        otherwise = "" if scale else _wait_for_it(facts, index, behind) or _if_recorded(facts, index, behind)
        yield Fault(text, f"{right}{mapped}{otherwise}", blocks(facts, an_input), input=index)


def _to_the_usual_time(facts: GroupFacts, an_input: InputFacts, scale: TimeScale | None) -> str:
    if facts.clock is not None:
        return f"check that {nodes(an_input)} uses simulated time as well"
    return f"have {nodes(an_input)} stamp with the host's time" if scale else "synchronize the clocks of their machines"


def _if_recorded(facts: GroupFacts, index: int, behind: int) -> str:
    is_old = behind > _LATENCY and facts.clock is None and not facts.is_recorded
    return f"; if {nodes(facts.inputs[index])} plays a recording, take all inputs from it" if is_old else ""


def _least_delay(figures: InputFigures) -> int:
    """Return how late the quickest messages are: of the last, or if all of these are late, of those of the minute."""
    usual = Distribution(figures.delays).quantile(_LEAST_DELAY)
    return usual if figures.least_delay is None else min(usual, figures.least_delay, key=abs)


def _misread(facts: GroupFacts) -> Found:
    """Find inputs whose stamps do not run as time does; none where all run alike, as those of a player do."""
    readings = {index: each.figures.reading for index, each in enumerate(facts.inputs) if each.figures.stamps}
    rates = [each.rate for each in readings.values() if each is not None and not each.is_unit]
    if 1 < len(rates) == len(readings) and max(rates) - min(rates) <= _SAME_RATE * min(rates):
        return
    for index, reading in readings.items():
        an_input = facts.inputs[index]
        if reading is None:
            continue
        # Delays that grow look like another rate, but then they grow little, and cost few sets.
        is_sure = reading.is_unit or reading.strayed > _OTHER_CLOCK
        if not (is_sure or facts.has_stopped or facts.standing is not Standing.ENOUGH):
            continue
        what = reading.what if reading.is_unit else f"{reading.what} {facts.clock_name}"
        if reading.is_unit:
            right = "writes whole seconds into sec and the rest, in nanoseconds, into nanosec"
        elif facts.clock is not None:
            right = "uses simulated time as well"
        else:
            right = "stamps with the host's time, not with that of a simulation or a recording, or a counter of its own"
        yield Fault(
            f"stamps of {an_input.name} {what}",
            f"check that {nodes(an_input)} {right}{_or_mapped(facts, index)}",
            blocks(facts, an_input),
            input=index,
        )


def offered_offset(facts: GroupFacts, code: Code, index: int, by: int) -> str:
    """Say what offset to write and what it gives, tried where there are messages; nothing where it does not help."""
    name = facts.inputs[index].name
    if facts.suggester is None:
        return f"write `offset: {words.exactly(by)}` at {name}"

    def question(trials: Trials) -> Verdict:
        near = trials.clock_offset(index) if code is Code.OTHER_CLOCK else None
        near = near or next((each for each in trials.offsets() if each.input == index), None)
        if near is None or abs(parse_duration(near.value) - by) > _SAME_OFFSET * abs(by):
            near = offset_change(index, by)
        if near is None:
            return UNTRIED
        by_clock = code is Code.OTHER_CLOCK
        tried = by_offset_of_clock(trials, index, near) if by_clock else trials.by_offset(near)
        return Verdict(() if tried is None else (tried,))

    found = facts.suggester.ask((code, index), question, now=facts.figures.now).tried
    if not found:
        return ""
    (change,) = found[0].changes
    gives = f"which would give {found[0].given} of {found[0].possible} possible sets"
    return f"write `offset: {change.value}` at {name}, {gives}"


def _or_mapped(facts: GroupFacts, index: int, by: int | None = None) -> str:
    """Offer an offset where stamps are off by a constant that is known, else to have them mapped."""
    if by is None and facts.suggester is None:
        return _or_by_arrival(facts, facts.inputs[index])
    advice = "" if by is None else offered_offset(facts, Code.OTHER_CLOCK, index, by)
    # A clock that was set may be set again.
    if advice and not facts.inputs[index].figures.stepped:
        return f", or {advice}"
    return offered_stamps(facts, Code.OTHER_CLOCK, index) or (f", or {advice}" if advice else "")


def _wait_for_it(facts: GroupFacts, index: int, behind: int) -> str:
    """Offer a longer queue, if one was tried and helps: stamps that seem old may be of results that take long."""
    if facts.suggester is None or not 0 < behind < _LATENCY:
        return ""
    about, keys = (Code.OTHER_CLOCK, index, "queue_size"), {"queue_size", "policy"}
    found = facts.suggester.ask(about, lambda trials: trials.verdict(REQUIRED, keys), now=facts.figures.now).tried
    if not found:
        return ""
    return (
        f"; if {facts.inputs[index].name} really takes that long to arrive, write {written(facts, found[0].changes)},"
        f" which would give {found[0].given} of {found[0].possible} possible sets"
    )


def no_common_key(facts: GroupFacts) -> Found:
    """Find that inputs that are matched by key have none in common."""
    if facts.by_stamp or not facts.is_silent or not facts.had_time or any(each.key is None for each in facts.inputs):
        return
    newest = ", ".join(f"{each.key!r} of {each.name}" for each in facts.inputs)
    yield Fault(
        f"no key arrived on all inputs while it was buffered; the newest are {newest}",
        "correct `key`, or write a larger `queue_size` if one input's keys arrive much later",
        Severity.ERROR,
    )


def several_publishers(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find that the stamps of those who publish an input conflict."""
    figures = an_input.figures
    publishers = [each for each in an_input.graph.publishers if each.type == an_input.type]
    if len(publishers) < 2:  # noqa: PLR2004  one alone conflicts with nobody
        return
    disorder = figures.out_of_order + (0 if facts.is_held(index) else figures.duplicates) if facts.by_stamp else 0
    # Whatever messages are matched by, it begins anew when stamps fall.
    if swings(an_input):
        conflict = f"their stamps are {words.span_of_time(figures.swung_by)} apart"
    elif disorder > _FAULTY * figures.fed:
        conflict = f"{counted(disorder, figures.fed)} messages repeat a stamp or arrived out of stamp order"
    else:
        return
    *first, last = [each.node for each in publishers]
    who = f"{', '.join(first)} and {last} {'all' if len(first) > 1 else 'both'}"
    yield Fault(
        f"{who} publish {an_input.name}: {conflict}",
        "give each publisher its own topic, or stop all but one",
        blocks(facts, an_input),
        explains=swings(an_input) or _matters(facts, an_input, disorder),
    )


def swings(an_input: InputFacts) -> bool:
    """Whether stamps of an input jump back and forth, so that the matching of its group restarts each time."""
    return an_input.figures.swings >= _FEWEST_SWINGS


def clock_step(facts: GroupFacts) -> Found:
    """Find a clock that was set: this machine's, that of one input, or the one that stamps them all."""
    now = facts.figures.now
    if facts.clock_set is not None:
        text = f"this machine's clock was set {_forward(facts.clock_set.by)}, {_ago(now, facts.clock_set.at)}"
        yield Fault(text, _SLEW.format(where="here"))
        return
    if not facts.by_stamp:
        return
    steps = {index: step for index, each in enumerate(facts.inputs) if (step := each.figures.stepped)}
    if 1 < len(steps) == len(facts.inputs) and _is_one_step(facts, steps.values()):
        # All that changes by less may be the way to us, and a recording that is looped is no clock that was set back.
        last = max(steps.values())
        if (-_LOOPED < last.by <= -STEP_NS or last.by >= STEP_NS) and is_told(facts, last):
            text = f"stamps of all inputs jumped {_forward(last.by)} against this machine's clock, {_ago(now, last.at)}"
            yield Fault(text, _SLEW.format(where="on the machine that stamps them"))
        return
    if any(each.figures.may_step for each in facts.inputs):
        return
    for index, step in steps.items():
        an_input = facts.inputs[index]
        # What does not run as time does steps all the time.
        if an_input.figures.reading is None and is_told(facts, step):
            is_harmful = _left_until(facts, step.at)
            yield Fault(
                f"stamps of {an_input.name} jumped {_forward(step.by)}, {_ago(now, step.at)}"
                f"{_of_others(facts, index, step.at)}",
                _SLEW.format(where=f"of {nodes(an_input)}") + offered_stamps(facts, Code.CLOCK_STEP, index),
                blocks(facts, an_input) if is_harmful else Severity.OK,
                input=index,
                explains=is_harmful,
            )


def _left_until(facts: GroupFacts, at: int) -> bool:
    """Whether sets left until a time: what happened where none did has not cost any, and may have mended something."""
    few = round(_FEW_SETS * SECOND / facts.possible_hz) if facts.possible_hz else 0
    return any(0 <= at - seen <= _LOOK + few for seen in facts.figures.left_at)


def is_told(facts: GroupFacts, step: Step) -> bool:
    """Whether a step is recent, and great enough to cost sets. What comes of it later has findings of its own."""
    # A simulated clock comes in ticks, which make delays of their own.
    tolerance = None if facts.clock is not None else facts.tolerance
    enough = STEP_NS if tolerance is None else min(STEP_NS, round(_MATTERS * tolerance.ns))
    return abs(step.by) >= enough and 0 <= facts.figures.now - step.at < _TOLD_JUMP


def _is_one_step(facts: GroupFacts, steps: Iterable[Step]) -> bool:
    at, by = [step.at for step in steps], [step.by for step in steps]
    # Of a slow input, it is the next message that shows it.
    slowest = min((each.figures.usual_hz for each in facts.inputs if each.figures.usual_hz), default=0.0)
    if max(at) - min(at) > _LOOK + (2 * SECOND / slowest if slowest else 0):
        return False
    return max(by) - min(by) < max(_STEPPED_ALIKE * max(map(abs, by)), SECOND // 20)


def _of_others(facts: GroupFacts, index: int, at: int) -> str:
    """Say that the others' stamps did not jump, where each had messages before and after that moment."""
    others = [each.figures for other, each in enumerate(facts.inputs) if other != index]
    are_known = all((each.flows_since or at) < at < (each.last_received or at) for each in others)
    return (
        "; those of the other inputs did not"
        if are_known and not any(each.stepped and each.stepped.at >= at - _TOLD_JUMP for each in others)
        else ""
    )


def _forward(by: int) -> str:
    return f"{'forward' if by > 0 else 'back'} by {words.span_of_time(abs(by))}"


def _ago(now: int, at: int) -> str:
    return f"{words.seconds(max(0, now - at))} ago"


def time_jump(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find that stamps fell back; without blame, unless they do so again and again."""
    now, figures = facts.figures.now, an_input.figures
    if figures.reading is not None:
        return
    if facts.by_stamp and swings(an_input):
        yield Fault(
            f"timestamps of {an_input.name} jump back and forth by {words.span_of_time(figures.swung_by)}",
            f"check whether {nodes(an_input)} stamps by two clocks, or two nodes publish {an_input.name}",
            blocks(facts, an_input),
        )
    elif figures.fell_at is not None and figures.fell_by is not None and now - figures.fell_at < _TOLD_JUMP:
        yield Fault(
            f"timestamps of {an_input.name} jumped back {words.span_of_time(figures.fell_by)},"
            f" {_ago(now, figures.fell_at)}; matching restarted",
            "a looped recording does this, or a clock that was reset"
            + (offered_stamps(facts, Code.TIME_JUMP, index) if facts.has_stopped else ""),
            Severity.OK,
            explains=False,
        )


def out_of_order(facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find messages that came after one of a later stamp."""
    count = an_input.figures.out_of_order if an_input.figures.faulty_looks > 1 else 0
    if facts.by_stamp and count > _FAULTY * an_input.figures.fed:
        text = f"{counted(count, an_input.figures.fed)} messages of {an_input.name} arrived out of stamp order"
        yield Fault(text, f"check how {nodes(an_input)} stamps and sends", explains=_cost_sets(facts, count))


def _cost_sets(facts: GroupFacts, count: int) -> bool:
    """Whether so many messages of the window, of which each costs a set at most, account for most missing sets."""
    share = facts.figures.share
    return 0 < share.possible - share.left <= 2 * count * max(1.0, share.ns / WINDOW_NS)


def duplicates(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find messages that repeat a stamp; what is held until there is a newer one may be sent again and again."""
    count = an_input.figures.duplicates if an_input.figures.faulty_looks > 1 else 0
    if facts.by_stamp and not facts.is_held(index) and count > _FAULTY * an_input.figures.fed:
        text = f"{counted(count, an_input.figures.fed)} messages of {an_input.name} repeat the stamp before them"
        text += f": all are multiples of {words.duration(unit)}" if (unit := an_input.figures.resolution) else ""
        yield Fault(text, f"check how {nodes(an_input)} stamps its messages", explains=_matters(facts, an_input, count))
