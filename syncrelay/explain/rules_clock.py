"""Findings about sets that a clock triggers: stamps that are off the clock, messages too old at its ticks."""

from math import inf
from statistics import median_low
from typing import Final

from syncrelay.config import Distance
from syncrelay.explain import words
from syncrelay.explain.codes import Code, Severity
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.findings import SECOND, Fault, Found
from syncrelay.explain.other_stamps import offered_stamps
from syncrelay.explain.rules_flow import waited_for_relay

_OFF: Final = SECOND
_NEARLY_ALL: Final = 0.95
_WATCHED: Final = 10 * SECOND
_HEADROOM: Final = 1.25


def off_the_clock(facts: GroupFacts) -> Found:
    """Find required inputs whose stamps are so far off the clock that triggers that no tick can use them."""
    if facts.ticks_hz is None or not facts.is_silent or facts.is_new:
        return
    limit = max(_OFF, 2 * max(waited_for_relay(facts)))
    required = [(index, each) for index, each in enumerate(facts.inputs) if each.required]
    late = {index: lag - each.offset for index, each in required if (lag := facts.lag(index)) is not None}
    oldest = {
        index: inf if tolerance is None else max(limit, tolerance.ns + (facts.max_wait or 0))
        for index in late
        for tolerance in [facts.tolerance_of(index)]
    }
    off = {index: by for index, by in late.items() if by < -limit or by > oldest[index]}
    if not off:
        return
    index = max(off, key=lambda each: abs(off[each]))
    by = off[index]
    are_all = len(off) == len(required) > 1 and max(off.values()) - min(off.values()) < _OFF
    whose = "all inputs" if are_all else facts.inputs[index].name
    others = [each for each in off if each != index]
    mapped = offered_stamps(facts, Code.OTHER_CLOCK, index, *others)
    yield Fault(
        f"stamps of {whose} are {words.behind(by)} {facts.clock_name}, which triggers the sets",
        _to_one_clock(facts) + mapped,
        Severity.ERROR,
        input=None if are_all else index,
    )


def _to_one_clock(facts: GroupFacts) -> str:
    """Say what to do where stamps are off the clock that triggers."""
    if facts.is_recorded:
        return (
            "record what a simulation publishes with `ros2 bag record --use-sim-time`, or let an input be the `trigger`"
        )
    if facts.clock is None:
        return (
            "with a simulation or a recording, write `node: {use_sim_time: true}` and play it with --clock; else"
            " synchronize the clocks of the machines"
        )
    return "check whether what publishes these topics uses simulated time as well"


def too_old(facts: GroupFacts) -> Found:
    """Find the required input whose latest message is too old, by how late and how seldom it comes.

    At the messages of a trigger, only those that have a tolerance of their own: the others are measured.
    """
    figures = facts.figures
    was_watched = figures.now - max(figures.began, figures.resumed or 0) >= _WATCHED
    lacks_sets = was_watched and figures.rate_hz < _NEARLY_ALL * facts.possible_hz
    if facts.distance is not Distance.AGE or not (facts.is_silent or lacks_sets):
        return
    known = [
        (*ages, tolerance, index)
        for index, each in enumerate(facts.inputs)
        if each.required and (facts.trigger is None or each.own_tolerance is not None)
        if (tolerance := facts.tolerance_of(index)) is not None and (ages := _ages(facts, each)) is not None
    ]
    if not known:
        return
    least, most, max_age, index = max(known, key=lambda each: each[1] - each[2].ns)
    if most <= max_age.ns:
        return
    an_input = facts.inputs[index]
    where = "a tick" if facts.trigger is None else f"a message of {facts.inputs[facts.trigger].name}"
    at = "" if an_input.own_tolerance is None else f" at {an_input.name}"
    yield Fault(
        f"at {where}, the latest message of {an_input.name} is {words.duration(least)} to {words.duration(most)} old,"
        f" {max_age.key} is {words.duration(max_age.ns)}",
        f"write `{max_age.key}: {words.at_least(round(_HEADROOM * most))}`{at}"
        f"{_or_wait(facts, index, most - least, max_age.ns)}",
        Severity.ERROR if facts.is_silent else Severity.WARN,
    )


def _ages(facts: GroupFacts, an_input: InputFacts) -> tuple[int, int] | None:
    """Return how old its latest message is at ticks or triggers, at least and at most; None of too few to tell."""
    figures = an_input.figures
    if not figures.delays or not figures.pace_hz:
        return None
    # A trigger waits for what comes late.
    waited = facts.trigger is not None
    late = 0 if waited else max(0, median_low(figures.delays) - an_input.offset - (facts.max_wait or 0))
    return late, late + round(SECOND / figures.pace_hz)


def _or_wait(facts: GroupFacts, index: int, period: int, limit: int) -> str:
    """Offer to wait for messages that come late, where that alone would do."""
    an_input = facts.inputs[index]
    late = (an_input.figures.delay or 0) - an_input.offset
    if late <= (facts.max_wait or 0) or facts.ticks_hz is None or period > limit:
        return ""
    return f", or `max_wait: {words.at_least(round(_HEADROOM * late))}`, which delays every set by that"
