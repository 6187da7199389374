"""Findings about the flow: queues, waiting, losses, how many of the possible sets leave."""

from statistics import median_low
from typing import Final

from syncrelay.explain import words
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.findings import SECOND, Code, Finding, Found, Severity, counted, nodes
from syncrelay.explain.rules_stamps import other_clock
from syncrelay.sync.messages import DropReason

_MISSING: Final = 0.05
# An input is back when so many times as many sets have it as had one without it on average before.
_BACK: Final = 3
# It is away when so many of its messages did not come.
_AWAY: Final = 3
_FEWEST: Final = 5
_TOO_SLOW: Final = 500_000_000
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


def bursts(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find messages that are held up on their way and then come at once."""
    figures = an_input.figures
    # Where the relay itself was held up, all messages come at once.
    if not figures.bursts or _waited(facts) >= _TOO_SLOW:
        return
    times = "once" if figures.bursts == 1 else f"{figures.bursts} times"
    who = nodes(an_input)
    yield Finding(
        Code.BURSTS,
        Severity.WARN,
        f"{times} in the last 10 s messages of {an_input.name} came at once, up to {words.duration(figures.held)} late",
        "where the network loses packets, reliable publishers send again at their next heartbeat only, each 3 s by"
        f" default: run {who} with configs/fast_heartbeats.xml, or best effort; else see whether {who} sends in bursts,"
        " or a recorder stood still",
        index,
    )


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


def messages_lost(_facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find messages that DDS itself lost before they came here."""
    if an_input.graph.lost:
        messages = "1 message" if an_input.graph.lost == 1 else f"{an_input.graph.lost} messages"
        yield Finding(
            Code.MESSAGES_LOST,
            Severity.WARN,
            f"DDS lost {messages} of {an_input.name} on the way here in the last 10 s",
            f"look at the network and the load; what {nodes(an_input)} offers as reliable, `qos: auto` asks for again",
            index,
        )


def too_slow(facts: GroupFacts) -> Found:
    """Find that messages of the group waited for the relay."""
    waited = _waited(facts)
    if waited >= _TOO_SLOW:
        yield Finding(
            Code.TOO_SLOW,
            Severity.WARN,
            f"messages waited up to {words.duration(waited)} for the relay",
            "check whether other processes leave it enough CPU; if they do, spread the groups over several relays with"
            " --group",
        )


def _waited(facts: GroupFacts) -> int:
    """Return how long messages waited for the relay: unread by it, or outside while the whole process stood still.

    A standstill alone has kept nothing waiting. It has where messages that came at once were held up then.
    """
    return max(facts.waited, *(_waited_outside(facts, each) for each in facts.inputs))


def _waited_outside(facts: GroupFacts, an_input: InputFacts) -> int:
    if facts.standstill is None:
        return 0
    until, ns = facts.standstill
    return max((min(end, until) - max(begin, until - ns) for begin, end in an_input.figures.held_up), default=0)


def slowed(_facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find an input that comes at less than half of the rate that it always had."""
    figures = an_input.figures
    if figures.slowed_from_hz is not None:
        yield Finding(
            Code.SLOWED,
            Severity.WARN,
            f"{an_input.name} comes at {words.rate(figures.pace_hz)}, it came at {words.rate(figures.slowed_from_hz)}",
            f"look at {nodes(an_input)}: its settings, its load, and the network on the way",
            index,
        )


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


def fates(an_input: InputFacts) -> str:
    """Say what most often became of an input's messages."""
    figures = an_input.figures
    if not figures.fed:
        return f"of {an_input.name} none came lately"
    dropped = sorted(figures.dropped.items(), key=lambda item: -item[1])[:2]
    parts = " and ".join(f"{count} were dropped as {reason.value}" for reason, count in dropped)
    return f"of {an_input.name}'s last {figures.fed} messages {parts or 'none was dropped'}"
