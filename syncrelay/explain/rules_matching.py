"""Findings about matching: sets too wide, queues too short, optional inputs left out, sets that do not leave."""

from statistics import median_low
from typing import Final

from syncrelay.explain import words
from syncrelay.explain.distribution import Distribution
from syncrelay.explain.facts import GroupFacts, InputFacts, Tolerance
from syncrelay.explain.findings import SECOND, Code, Finding, Found, Severity, counted, nodes
from syncrelay.explain.rules_flow import fates
from syncrelay.explain.rules_stamps import other_clock
from syncrelay.sync.messages import DropReason

# A share of the slowest input's messages that could have no set, and from how many on it means something.
_MISSED: Final = 0.05
_FEWEST: Final = 5
# Where messages were held up, what is apart tells of slop only if it is most.
_MOST: Final = 0.5
_MISSING: Final = 0.05
# An input is back when so many times as many sets have it as had one without it on average before.
_BACK: Final = 3
# It is away when so many of its messages did not come.
_AWAY: Final = 3
# Fewer sets than this share of the possible ones are few, where so many were possible in so long a time.
_FEW: Final = 0.8
# Nearly all sets that were possible: then what a queue dropped was not missed.
_NEARLY_ALL: Final = 0.95
_POSSIBLE: Final = 10
_WATCHED: Final = 10 * SECOND
_WHAT_HELPS: Final = {
    DropReason.OVERFLOW: "a larger `queue_size`",
    DropReason.TOO_FAR: "a wider slop",
    DropReason.EXPIRED: "a larger `max_wait`",
    DropReason.LATE: "a policy or a `queue_size` that waits longer, such as `approximate_time`",
    DropReason.DUPLICATE: "stamps that differ from message to message",
    DropReason.UNSTAMPED: "`stamp: receive`",
}


def over_slop(facts: GroupFacts) -> Found:
    """Find that the sets that could be had are too wide for the file."""
    tolerance = facts.tolerance
    nearest = facts.figures.nearest_since if facts.is_silent else facts.figures.nearest
    if tolerance is None or len(nearest) < _FEWEST or next(other_clock(facts), None):
        return
    over = nearest.share_over(tolerance.ns)
    if facts.is_silent and over > 1 - _MISSED:
        text, suggestion = _too_wide(facts, tolerance, nearest), _wide_enough(facts, tolerance, nearest)
        yield Finding(Code.OVER_SLOP, Severity.ERROR, text, suggestion)
    elif not facts.is_silent and over > (_MOST if _come_at_once(facts) else _MISSED):
        text, suggestion = _often_too_wide(facts, tolerance, nearest)
        yield Finding(Code.OVER_SLOP, Severity.WARN, text, suggestion)


def _come_at_once(facts: GroupFacts) -> bool:
    """Whether what is measured as far apart may only have been held up: a wider slop would pair what came together."""
    return any(each.required and each.figures.bursts for each in facts.inputs)


def _often_too_wide(facts: GroupFacts, tolerance: Tolerance, nearest: Distribution) -> tuple[str, str]:
    missed = f"{words.share(nearest.share_over(tolerance.ns))} of the last {len(nearest)} messages of"
    name = facts.pacemaker.name
    if facts.policy == "exact_time":
        # Others do have equal stamps: a wider slop would pair what does not belong together.
        lost = "look for messages that a driver leaves out or the network loses"
        return f"{missed} {name} have no partner of an equal stamp", lost
    farther = f"{missed} {name} were farther from their partners than {tolerance.key} {words.duration(tolerance.ns)}"
    return farther, _wide_enough(facts, tolerance, nearest)


def _too_wide(facts: GroupFacts, tolerance: Tolerance, nearest: Distribution) -> str:
    least, most = words.duration(nearest.quantile(0)), words.duration(nearest.quantile(0.95))
    widths = least if least == most else f"{least} to {most}"
    if facts.policy == "exact_time":
        return f"no stamps are equal: the nearest sets span {widths}"
    if tolerance.key == "max_age":
        return f"the latest messages are {widths} older than the trigger's, over max_age {words.duration(tolerance.ns)}"
    return f"the nearest sets span {widths}, over slop {words.duration(tolerance.ns)}"


def _wide_enough(facts: GroupFacts, tolerance: Tolerance, nearest: Distribution) -> str:
    most, nearly_all = words.at_least(nearest.quantile(0.95)), words.at_least(nearest.quantile(0.99))
    policy = "`policy: approximate_time` and " if facts.policy == "exact_time" else ""
    less = "" if most == nearly_all else f", `{tolerance.key}: {most}` would match 95 %"
    return f"write {policy}`{tolerance.key}: {nearly_all}`, which would match 99 %{less}"


def short_queue(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find messages that overflowed and then were missed."""
    needed = an_input.counts.needed_queue
    overflowed = an_input.figures.dropped.get(DropReason.OVERFLOW, 0)
    if needed is None or not overflowed or needed <= facts.queue_size:
        return
    if not facts.is_silent and facts.figures.rate_hz >= _NEARLY_ALL * facts.possible_hz:
        return
    if next(other_clock(facts), None):
        return  # what waits for a partner of another clock overflows any queue
    yield Finding(
        Code.SHORT_QUEUE,
        Severity.ERROR if facts.is_silent else Severity.WARN,
        f"{counted(overflowed, an_input.figures.fed)} messages of {an_input.name} overflowed its queue of"
        f" {facts.queue_size} before their partners came",
        f"write `queue_size: {needed}`",
        index,
    )


def waiting_for_optional(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find an optional input that sets leave without; the causes that are told are those that were seen."""
    missing = facts.figures.missing[index]
    if an_input.required or missing <= _MISSING or not facts.figures.rate_hz:
        return
    if missing * facts.figures.sets_since_without[index] >= _BACK:
        return
    waits = f" after waiting {words.duration(facts.max_wait)} for it" if facts.max_wait else ""
    why, what_helps = _why_without(facts, an_input)
    yield Finding(
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        f"{words.share(missing)} of the sets leave without {an_input.name}{waits}{why}",
        what_helps,
        index,
    )


def _why_without(facts: GroupFacts, an_input: InputFacts) -> tuple[str, str]:
    """Tell an input that is away, stamps that fit no set, and messages that come after theirs has left."""
    unknown = "", f"see whether {nodes(an_input)} sends it, and how late it comes"
    name, tolerance, nearest = an_input.name, facts.tolerance, an_input.figures.nearest
    if (away := _away(facts, an_input)) is not None:
        return away
    if tolerance is None or len(nearest) < _FEWEST:
        return unknown
    behind = _behind(facts, an_input)
    if abs(behind) > max(SECOND, tolerance.ns):
        side = "behind" if behind > 0 else "ahead of"
        return (
            f": its stamps are {words.duration(abs(behind))} {side} those of the others",
            f"synchronize their clocks, or write `offset: {words.exactly(behind + an_input.offset)}` at {name}",
        )
    if nearest.quantile(0.5) > tolerance.ns:
        widths = f"{words.duration(nearest.quantile(0))} to {words.duration(nearest.quantile(0.95))}"
        return (
            f": the nearest sets with it span {widths}, over {tolerance.key} {words.duration(tolerance.ns)}",
            f"write `{tolerance.key}: {words.at_least(nearest.quantile(0.99))}`, which would take in 99 %",
        )
    if facts.max_wait is not None and behind > facts.max_wait:
        return (
            f": it comes {words.duration(behind)} after the others, too late",
            f"write a larger `max_wait`, or see what holds {name} up",
        )
    return unknown


def _away(facts: GroupFacts, an_input: InputFacts) -> tuple[str, str] | None:
    """Say that an input does not come at all, or not any more; None if it comes."""
    figures = an_input.figures
    look = f"look at {nodes(an_input)}"
    if figures.last_received is None:
        return ": no message of it has come", look
    quiet = facts.figures.now - figures.last_received
    usual = round(SECOND / figures.usual_hz) if figures.usual_hz else 0
    if quiet > max(SECOND, _AWAY * usual):
        return f": it has not come for {words.seconds(quiet)}", look
    return None


def _behind(facts: GroupFacts, an_input: InputFacts) -> int:
    """Return how much later after its stamp a message comes than those of the required inputs, in nanoseconds."""
    required = ((each.figures.delay, each.offset) for each in facts.inputs if each.required)
    delays = [delay - offset for delay, offset in required if delay is not None]
    own = an_input.figures.delay
    return own - an_input.offset - median_low(delays) if own is not None and delays else 0


def few_sets(facts: GroupFacts) -> Found:
    """Find that far fewer sets leave than the input that sets the pace would allow."""
    figures = facts.figures
    # The window's rate counts a silence that is over.
    since = max(figures.began, figures.resumed or 0)
    if facts.is_silent or figures.last_set is None or figures.now - since < _WATCHED:
        return
    if facts.possible_hz * _WATCHED < _POSSIBLE * SECOND or figures.rate_hz >= _FEW * facts.possible_hz:
        return
    pacemaker = facts.pacemaker
    reason = max(pacemaker.figures.dropped, key=lambda each: pacemaker.figures.dropped[each], default=None)
    yield Finding(
        Code.FEW_SETS,
        Severity.WARN,
        f"{words.figure(figures.rate_hz)} of {words.figure(facts.possible_hz)} possible sets a second leave;"
        f" {fates(pacemaker)}",
        f"{_WHAT_HELPS[reason]} would give more" if reason in _WHAT_HELPS else None,
    )
