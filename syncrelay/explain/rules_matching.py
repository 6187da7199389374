"""Findings about matching: sets too wide, queues too short, optional inputs left out, sets that do not leave."""

from collections.abc import Callable, Hashable
from itertools import groupby
from math import sqrt
from statistics import median_low
from typing import Final

from syncrelay.config import Distance, Tolerance
from syncrelay.config.units import parse_duration
from syncrelay.config.wording import all_of
from syncrelay.explain import words
from syncrelay.explain.apart import over_tolerances, who_is_off, wider_tolerances
from syncrelay.explain.codes import Code, Severity
from syncrelay.explain.distribution import Distribution
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.findings import SECOND, Fault, Found, absence, counted, nodes, written
from syncrelay.explain.other_stamps import by_offset_of_clock, by_other_stamps, wandering
from syncrelay.explain.rhythm import LEAST_PERIOD
from syncrelay.explain.rules_flow import fates
from syncrelay.explain.rules_offset import constant_offset
from syncrelay.explain.rules_stamps import other_clock
from syncrelay.explain.standing import Standing
from syncrelay.explain.trials import REQUIRED, UNTRIED, Trials, Tried, Verdict
from syncrelay.sync.messages import DropReason

# Sets are too wide if this share of the slowest input's messages has no set, and at least this many were measured.
_MISSED: Final = 0.05
_FEWEST: Final = 5
# Where no set leaves, and none of so few could, that is why.
_FEWEST_OF_NONE: Final = 3
# So many show that none is near: of those that a relay misses some are, and a few may be of before.
_SHOWN_BY: Final = 10
# So unlikely is chance.
_BY_CHANCE: Final = 0.001
# Where messages were held up, wide spans say something about slop only if most are wide.
_MOST: Final = 0.5
_MISSING: Final = 0.05
# An input is back after this many times as many sets with it as usually came between two sets without it.
_BACK: Final = 3
# It is away when this many of its messages are overdue.
_AWAY: Final = 3
_SILENT: Final = 5 * SECOND
# An input that sent a single message has no known period. Wait for it no longer than this.
_UNKNOWN: Final = 2 * SECOND
# If this share of the possible sets left, no set was missed for what a queue dropped.
_NEARLY_ALL: Final = 0.95
_WATCHED: Final = 10 * SECOND
# An input has paused where it did not come for this long, and for so many periods.
_PAUSE: Final = SECOND
_PAUSE_PERIODS: Final = 5
# What fills queues before all inputs have come says nothing of their size.
_YOUNG: Final = 2 * SECOND
# The keys that help where a queue overflowed, and where a message came too late for its set.
_QUEUE: Final = frozenset({"queue_size"})
_WAITING: Final = frozenset({"queue_size", "max_wait"})


def over_slop(facts: GroupFacts) -> Found:
    """Find that the sets that could be had are too wide for the file."""
    tolerance = facts.tolerance
    nearest = facts.figures.nearest_since if facts.has_stopped else facts.figures.nearest
    if tolerance is None or len(nearest) < (_FEWEST_OF_NONE if facts.has_stopped else _FEWEST):
        return
    if next(other_clock(facts), None):
        return
    gives_few = facts.has_stopped or facts.standing is Standing.FEW
    severity = Severity.ERROR if facts.is_silent else Severity.WARN
    if gives_few and (narrow := over_tolerances(facts)) is not None:
        yield Fault(narrow, _tolerance_advice(facts, REQUIRED), severity)
        return
    if facts.has_stopped and nearest.share_over(tolerance.ns) > 1 - _MISSED:
        text = _too_wide(facts, tolerance, nearest)
    elif _is_often_over(facts, tolerance, nearest):
        text, severity = _often_too_wide(facts, tolerance, nearest), Severity.WARN
    else:
        return
    found = _verdict(facts, (Code.OVER_SLOP, None), lambda trials: _wide_enough(facts, tolerance, nearest, trials))
    check = "check how these topics are stamped, and whether messages are missing"
    if len(nearest) < _FEWEST:
        check = "wait for some more messages: it is not known yet what would help"
    were_wide = round(nearest.share_over(tolerance.ns) * len(nearest))
    paused = {_longest_pause(each, were_wide): each for each in facts.inputs if not each.figures.bursts}
    if severity is Severity.WARN and (pause := max(paused, default=0)):
        text += f"; {paused[pause].name} paused for up to {words.duration(pause)}"
        check = f"check {nodes(paused[pause])}, and the network to it"
    coarse = {each.name: unit for each in facts.inputs if (unit := each.figures.resolution) > tolerance.ns}
    if 0 < len(coarse) < len(facts.inputs):
        text += "".join(f"; stamps of {name} are multiples of {words.duration(unit)}" for name, unit in coarse.items())
        check = f"check whether {all_of(coarse)} rounds its stamps"
    if facts.distance is Distance.SPAN and (off := who_is_off(facts)) is not None:
        text += f"; {off}"
    yield Fault(text, _advice(facts, found) or check, severity)


def _is_often_over(facts: GroupFacts, tolerance: Tolerance, nearest: Distribution) -> bool:
    """Whether so many of the nearest messages are farther apart than the tolerance that it is no chance."""
    # What was so a while ago, as while an input was away, is no more.
    lately = facts.figures.nearest_lately or nearest
    # As nearly always it is none of these, which are few.
    over = lately.share_over(tolerance.ns)
    over = over and min(nearest.share_over(tolerance.ns), over)
    came_at_once = any(each.required and each.figures.bursts for each in facts.inputs)
    # What was held up may only seem far apart, and a wider slop would pair what came together.
    least = _MOST if came_at_once else _beyond_chance(_MISSED, len(nearest))
    return over > least and not is_near_again(facts)


def _beyond_chance(share: float, count: int) -> float:
    """Return what share of so many is more than this share of all by two standard errors, and more than two."""
    return max(share + 2 * sqrt(share * (1 - share) / count), 2.5 / count)


def is_near_again(facts: GroupFacts) -> bool:
    """Whether the newest messages all have a near partner, and so many of them that the others are of the past."""
    tolerance, spans = facts.tolerance, facts.figures.nearest.newest(len(facts.figures.nearest))
    if tolerance is None or not spans or spans[0] > tolerance.ns:
        return False
    newest, *before = [len(list(run)) for is_near, run in groupby(spans, lambda each: each <= tolerance.ns) if is_near]
    # By the rule of succession: a few that were far do not show that all are.
    over = (sum(each > tolerance.ns for each in spans) + 1) / (len(spans) - newest + 2)
    # Where clocks drift through each other, they are near again and again.
    return (1 - over) ** newest < _BY_CHANCE and newest > 2 * max(before, default=0)


def none_is_near(facts: GroupFacts) -> bool:
    """Whether hardly any of the newest messages have a near partner, and no set leaves."""
    tolerance, nearest = facts.tolerance, facts.figures.nearest_since
    if tolerance is None or not facts.has_stopped or len(nearest) < _SHOWN_BY:
        return False
    return nearest.share_over(tolerance.ns) > 1 - _MISSED


def _often_too_wide(facts: GroupFacts, tolerance: Tolerance, nearest: Distribution) -> str:
    missed = f"{words.share(nearest.share_over(tolerance.ns))} of the last {len(nearest)} messages of"
    name = facts.pacemaker.name
    if tolerance.wider_policy:
        return f"{missed} {name} have no partner with an equal stamp"
    limit = f"{tolerance.key} {words.duration(tolerance.ns)}"
    most = words.duration(nearest.quantile(0.95))
    return f"{missed} {name} were farther from their partners than {limit}: up to {most}"


def _too_wide(facts: GroupFacts, tolerance: Tolerance, nearest: Distribution) -> str:
    least, most = words.duration(nearest.quantile(0)), words.duration(nearest.quantile(0.95))
    widths = least if least == most else f"{least} to {most}"
    if tolerance.wider_policy:
        return f"no stamps are equal: the nearest sets span {widths}"
    limit = f"{tolerance.key} {words.duration(tolerance.ns)}"
    if facts.distance is Distance.AGE:
        return f"the latest messages are {widths} older than the trigger's, over {limit}"
    return f"the nearest sets span {widths}, over {limit}"


def _wide_enough(
    facts: GroupFacts, tolerance: Tolerance, nearest: Distribution, trials: Trials, target: int | None = REQUIRED
) -> Verdict:
    """Find a wider tolerance and constant offsets that help."""
    for index in trials.required if target is REQUIRED else (target,):
        # What a clock wanders by, no tolerance holds for.
        if wandering(trials, index) and (mapped := by_other_stamps(trials, index, target, keys=["clock"])).tried:
            return mapped
    tried = trials.verdict(target, {tolerance.key, "policy", "queue_size"})
    wider = [parse_duration(each.value) for one in tried.tried for each in one.changes if each.key == tolerance.key]
    # What is far apart although others are near has no partner: a wider slop would pair what does not belong together.
    if not wider or nearest.share_over(wider[0]) > _MISSED or next(constant_offset(facts), None):
        tried = Verdict((), tried.may_miss)
    offsets = filter(None, map(trials.by_offset, dict.fromkeys(trials.offsets())))
    return tried._replace(tried=(*tried.tried, *offsets))


def _tolerance_advice(facts: GroupFacts, target: int | None) -> str:
    """Say which tolerances of inputs to write for a target, if they were tried."""
    changes = wider_tolerances(facts, target)

    def give(trials: Trials) -> Verdict:
        if not changes or not trials.is_enough(changes, target):
            return UNTRIED
        counts = trials.given(changes, target), trials.given((), target), len(trials.spans(target))
        return Verdict((Tried(changes, *counts),))

    optional = None if target is REQUIRED else facts.inputs[target].name
    advice = _advice(facts, _verdict(facts, ("tolerance", target), give), optional)
    return f"check how these topics are stamped, or {advice or 'write a wider `tolerance`'}"


def short_queue(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find messages that overflowed and then were missed."""
    needed = an_input.counts.needed_queue
    overflowed = an_input.figures.dropped.get(DropReason.OVERFLOW, 0)
    is_young = facts.figures.now - facts.figures.began < _YOUNG
    if needed is None or not overflowed or needed <= facts.queue_size or is_young or is_overdue(facts):
        return
    missed_hz = facts.possible_hz - facts.figures.rate_hz
    # A set that leaves a little later than the window ends was not missed.
    if not facts.is_silent and missed_hz * _WATCHED <= max(
        2 * SECOND, (1 - _NEARLY_ALL) * facts.possible_hz * _WATCHED
    ):
        return
    share = facts.figures.share
    # What did not come was missed whatever the queue holds, and fills those of the others.
    if not facts.is_silent and 2 * share.absent > share.possible - share.left > 0:
        return
    if next(other_clock(facts), None):
        return  # what waits for a partner of another clock overflows any queue
    found = _verdict(facts, (Code.SHORT_QUEUE, index), lambda trials: trials.verdict(REQUIRED, _QUEUE))
    if not found.may_miss:
        return
    yield Fault(
        f"{counted(overflowed, an_input.figures.fed)} messages of {an_input.name} overflowed its queue of"
        f" {facts.queue_size} before their partners came",
        _advice(facts, found),
        Severity.ERROR if facts.is_silent else Severity.WARN,
    )


def is_overdue(facts: GroupFacts) -> InputFacts | None:
    """Return a required input that has just ceased to come: no queue is long enough for that. Later it is silent."""
    for each in facts.inputs:
        quiet = facts.figures.now - (each.figures.last_received or 0)
        if each.required and quiet < _SILENT and quiet * _pace_hz(each) > 2 * _AWAY * SECOND:
            return each
    return None


def waiting_for_optional(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find an optional input that sets leave without; the causes that are told are those that were seen."""
    missing = facts.figures.missing[index]
    if an_input.required or not facts.figures.rate_hz:
        return
    away, rate_hz, pace_hz = _away(facts, an_input), facts.figures.rate_hz, _pace_hz(an_input)
    if away is None and not pace_hz:
        return
    # A slow optional input can be in no more sets than it has messages, and one may still be on its way.
    could_hz = min(rate_hz, pace_hz or rate_hz)
    had_hz = (1 - missing) * rate_hz + 2 * SECOND / _WATCHED
    if had_hz >= (1 - _MISSING) * could_hz or missing * facts.figures.sets_since_without[index] >= _BACK:
        return
    waits = f" after waiting {words.duration(facts.max_wait)} for it" if facts.max_wait else ""
    must = 1 - could_hz / rate_hz
    slow = f", {words.share(must)} because it comes at {words.rate(pace_hz)} only" if must > _MISSING else ""
    why, what_helps = away or _why_without(facts, index, an_input)
    yield Fault(
        f"{words.share(missing)} of the sets leave without {an_input.name}{waits}{'' if away else slow}{why}",
        what_helps,
        absence(facts, an_input) if away else Severity.WARN,
    )


def _why_without(facts: GroupFacts, index: int, an_input: InputFacts) -> tuple[str, str]:
    """Tell stamps that fit no set, and messages that come after theirs has left."""
    name, tolerance, nearest = an_input.name, facts.tolerance, an_input.figures.nearest
    about, behind = (Code.WAITING_FOR_OPTIONAL, index), _behind(facts, an_input)
    if tolerance is not None and abs(behind) > max(SECOND, tolerance.ns):
        found = _verdict(facts, about, lambda trials: _in_time(index, trials))
        return (
            f": its stamps are {words.behind(behind)} those of the others",
            f"synchronize their clocks{_or(_advice(facts, found, name))}",
        )
    if tolerance is None or len(nearest) < _FEWEST:
        found = _verdict(facts, about, lambda trials: trials.verdict(index, _QUEUE))
        return "", _advice(facts, found, name) or f"check whether messages of {name} arrive late or are lost"
    if nearest.quantile(0.5) > tolerance.ns:
        widths = f"{words.duration(nearest.quantile(0))} to {words.duration(nearest.quantile(0.95))}"
        found = _verdict(facts, about, lambda trials: _wide_enough(facts, tolerance, nearest, trials, index))
        return (
            f": the nearest sets with it span {widths}, over {tolerance.key} {words.duration(tolerance.ns)}",
            _advice(facts, found, name) or f"check how {nodes(an_input)} stamps its messages",
        )
    if (narrow := over_tolerances(facts, index)) is not None:
        return f": {narrow}", _tolerance_advice(facts, index)
    advice = _advice(facts, _verdict(facts, about, lambda trials: trials.verdict(index, _WAITING)), name)
    if facts.max_wait is not None and behind > facts.max_wait:
        return (
            f": it arrives {words.duration(behind)} after the others, too late",
            f"check what delays {name}{_or(advice)}",
        )
    return "", advice or f"check whether messages of {name} arrive late or are lost"


def _in_time(index: int, trials: Trials) -> Verdict:
    """Find an offset for an optional input of another clock, or other stamps."""
    offset = trials.clock_offset(index)
    tried = None if offset is None else by_offset_of_clock(trials, index, offset, index)
    return by_other_stamps(trials, index, index) if tried is None else Verdict((tried,))


def _away(facts: GroupFacts, an_input: InputFacts) -> tuple[str, str] | None:
    """Say that an input does not come at all, or not any more; None if it comes."""
    figures = an_input.figures
    look = f"check {nodes(an_input)}"
    if figures.last_received is None:
        return ": no message of it has arrived", look
    quiet = facts.figures.now - figures.last_received
    pace_hz = _pace_hz(an_input)
    if quiet > max(SECOND, _AWAY * (round(SECOND / pace_hz) if pace_hz else _UNKNOWN)):
        return f": it has been silent for {words.seconds(quiet)}", look
    return None


def _pace_hz(an_input: InputFacts) -> float:
    """Return the rate at which an input comes while it does, 0 of too few messages to tell."""
    return an_input.figures.usual_hz or an_input.figures.rate_hz


def _behind(facts: GroupFacts, an_input: InputFacts) -> int:
    """Return how much later after its stamp a message comes than those of the required inputs, in nanoseconds."""
    required = ((each.figures.delay, each.offset) for each in facts.inputs if each.required)
    delays = [delay - offset for delay, offset in required if delay is not None]
    own = an_input.figures.delay
    return own - an_input.offset - median_low(delays) if own is not None and delays else 0


def few_sets(facts: GroupFacts) -> Found:
    """Find that far fewer sets leave than the input that sets the pace would allow."""
    if not has_few_sets(facts):
        return
    share = facts.figures.share
    pacemaker = facts.pacemaker if share.pacemaker is None else facts.inputs[share.pacemaker]
    severity = Severity.ERROR if facts.standing is Standing.NONE else Severity.WARN
    left = left_of_possible(facts)
    if 2 * share.absent > share.possible - share.left:
        pause = _longest_pause(pacemaker, share.absent)
        why = f"it paused for up to {words.duration(pause)}" if pause else "they are lost, or it leaves some out"
        yield Fault(
            f"{left}; {share.absent} of {share.possible} messages of {pacemaker.name} did not come: {why}",
            f"check {nodes(pacemaker)}, and the network to it",
            severity,
            input=share.pacemaker,
        )
        return
    yield Fault(f"{left}; {fates(pacemaker)}", more_sets(facts, Code.FEW_SETS), severity)


def _longest_pause(an_input: InputFacts, absent: int) -> int:
    """Return an input's longest pause, in nanoseconds, if most of so many absent messages fell into pauses; or 0."""
    figures = an_input.figures
    if not figures.gaps:
        return 0
    # Where most come at once, any pause is longer than is usual.
    usual = round(SECOND / figures.pace_hz) if figures.pace_hz else max(LEAST_PERIOD, median_low(figures.gaps))
    pauses = [each for each in figures.gaps if each >= max(_PAUSE, _PAUSE_PERIODS * usual)]
    return max(pauses, default=0) if 2 * sum(each // usual for each in pauses) > absent else 0


def is_too_soon(facts: GroupFacts) -> bool:
    """Whether too few messages of slow inputs have come to say how far apart they are."""
    measured = sum(each.required and each.own_tolerance is None for each in facts.inputs) > 1
    few = len(facts.figures.nearest_since) < _FEWEST_OF_NONE
    missing_for = min(facts.silent_for, facts.figures.now - facts.figures.hindered_until)
    return measured and facts.tolerance is not None and few and missing_for * facts.possible_hz < _FEWEST * SECOND


def left_of_possible(facts: GroupFacts) -> str:
    """Say how many of the possible sets left."""
    share = facts.figures.share
    return f"{share.left} of {share.possible} possible sets left in the last {words.seconds(share.ns)}"


def has_few_sets(facts: GroupFacts) -> bool:
    """Return whether sets leave, but far fewer than the input that sets the pace would allow."""
    is_known = facts.figures.share.value is not None
    return facts.standing is not Standing.ENOUGH and is_known and not facts.is_silent


def more_sets(facts: GroupFacts, code: Code) -> str | None:
    """Say what to write where a finding of this code has no cause that is known; None where nothing was found."""
    keys = {*_WAITING, "policy"}
    if facts.is_silent and facts.tolerance:
        keys.add(facts.tolerance.key)
    return _advice(facts, _verdict(facts, (code, None), lambda trials: trials.verdict(REQUIRED, keys)))


def _verdict(facts: GroupFacts, about: Hashable, question: Callable[[Trials], Verdict]) -> Verdict:
    return UNTRIED if facts.suggester is None else facts.suggester.ask(about, question, now=facts.figures.now)


def _advice(facts: GroupFacts, verdict: Verdict, optional: str | None = None) -> str | None:
    """Say what to write and what it would give: sets, or those with an optional input."""
    if not verdict.tried:
        return None
    sets = "possible sets" if optional is None else f"sets with {optional}"
    first, *others = verdict.tried
    gives = f"which would give {first.given} of {first.possible} {sets} (now {first.now})"
    more = "".join(
        f", or, {_condition(each)}{written(facts, each.changes)}, which would give {each.given}" for each in others
    )
    return f"{_condition(first)}write {written(facts, first.changes)}, {gives}{more}"


def _condition(tried: Tried) -> str:
    """Say under which condition a value is right: a small offset says that messages are of one moment."""
    is_small = any(each.key == "offset" and abs(parse_duration(each.value)) < SECOND for each in tried.changes)
    return "if both are measured at the same time, " if is_small else ""


def _or(advice: str | None) -> str:
    return f", or {advice}" if advice else ""
