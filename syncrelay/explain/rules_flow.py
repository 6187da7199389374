"""Findings about the flow: queues, waiting, losses, how many of the possible sets leave."""

from typing import Final

from syncrelay.explain import words
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.findings import SECOND, Code, Finding, Found, Severity, counted
from syncrelay.sync.messages import DropReason

_MISSING: Final = 0.05
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


def short_queue(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find messages that overflowed and then were missed."""
    needed = an_input.counts.needed_queue
    overflowed = an_input.figures.dropped.get(DropReason.OVERFLOW, 0)
    if needed is None or not overflowed or needed <= facts.queue_size:
        return
    if not facts.is_silent and facts.figures.rate_hz >= _NEARLY_ALL * facts.possible_hz:
        return
    yield Finding(
        Code.SHORT_QUEUE,
        Severity.ERROR if facts.is_silent else Severity.WARN,
        f"{counted(overflowed, an_input.figures.fed)} messages of {an_input.name} overflowed its queue of"
        f" {facts.queue_size} before their partners came",
        f"write `queue_size: {needed}`",
        index,
    )


def waiting_for_optional(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find an optional input that sets leave without."""
    missing = facts.figures.missing[index]
    if an_input.required or missing <= _MISSING or not facts.figures.rate_hz:
        return
    waits = f" after waiting {words.duration(facts.max_wait)} for it" if facts.max_wait else ""
    longer = "" if facts.max_wait is None else ", or write a larger `max_wait`"
    yield Finding(
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        f"{words.share(missing)} of the sets leave without {an_input.name}{waits}",
        f"see why {an_input.name} does not come in time{longer}",
        index,
    )


def messages_lost(_facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find messages that DDS itself lost before they came here."""
    if an_input.lost:
        messages = "1 message" if an_input.lost == 1 else f"{an_input.lost} messages"
        yield Finding(
            Code.MESSAGES_LOST,
            Severity.WARN,
            f"DDS lost {messages} of {an_input.name} on their way here in the last 10 s",
            f"look at the network and the load; if its publisher offers it, `qos: {{reliability: reliable}}` at"
            f" {an_input.name} asks again for what is lost",
            index,
        )


def too_slow(facts: GroupFacts) -> Found:
    """Find that the relay does not keep up."""
    if facts.waited >= _TOO_SLOW:
        yield Finding(
            Code.TOO_SLOW,
            Severity.WARN,
            f"messages lay here for {words.duration(facts.waited)} before the relay came to them",
            "give it more CPU, or spread the groups over several relays with --group",
        )


def few_sets(facts: GroupFacts) -> Found:
    """Find that far fewer sets leave than the input that sets the pace would allow."""
    figures = facts.figures
    if facts.is_silent or figures.last_set is None or figures.now - figures.began < _WATCHED:
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
