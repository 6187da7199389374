"""Findings about the flow: messages that come in bursts, wait, are lost or slow down."""

from typing import Final

from syncrelay.explain import words
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.findings import Code, Finding, Found, Severity, nodes

_TOO_SLOW: Final = 500_000_000


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


def fates(an_input: InputFacts) -> str:
    """Say what most often became of an input's messages."""
    figures = an_input.figures
    if not figures.fed:
        return f"of {an_input.name} none came lately"
    dropped = sorted(figures.dropped.items(), key=lambda item: -item[1])[:2]
    parts = " and ".join(f"{count} were dropped as {reason.value}" for reason, count in dropped)
    return f"of {an_input.name}'s last {figures.fed} messages {parts or 'none was dropped'}"
