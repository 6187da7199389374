"""Findings about the flow: messages that come in bursts, wait, are lost or slow down."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from statistics import median_low
from typing import Final

from syncrelay.explain import words
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.findings import SECOND, Fault, Found, nodes
from syncrelay.explain.graph_facts import InputGraph, Sender
from syncrelay.explain.rhythm import RECOVERED

_TOO_SLOW: Final = 500_000_000
# An input too slow to send this many messages in the time of a burst cannot show one.
_SHOWN_BY: Final = 5
_PAUSE_PERIODS: Final = 3
_CHECK_NETWORK: Final = "check the network and the CPU load"
# As many as Fast DDS keeps with keep_all.
_MOST_KEPT: Final = 5000
SENT_AGAIN: Final = 4 * SECOND
"""Reliable publishers send what the relay missed in a standstill again within this time."""


def bursts(facts: GroupFacts) -> Found:
    """Find messages that are held up on their way and then arrive at once; one finding for those held up together."""
    held_up = {index: each for index, each in enumerate(facts.inputs) if each.figures.bursts}
    if len(held_up) > 1 and _overlap([each.figures.held_up for each in held_up.values()]):
        held = max(each.figures.held for each in held_up.values())
        others = [each for index, each in enumerate(facts.inputs) if index not in held_up]
        are_all = all(each.figures.usual_hz * held < _SHOWN_BY * SECOND for each in others)
        names = "all inputs" if are_all else " and ".join(each.name for each in held_up.values())
        what = "the recorder" if facts.is_recorded else "a player"
        check = f"check whether this machine, {what} or what connects them stood still"
        yield Fault(_burst(names, *held_up.values()), check, inputs=tuple(held_up))
        return
    for index, each in held_up.items():
        who = nodes(each)
        check = (
            f"check whether {who} sent in bursts, or the recorder received it late"
            if facts.is_recorded
            else f"check whether {who} sends in bursts; if it runs on another machine, check the network: after a loss,"
            " reliable publishers send again only every 3 s by default; configs/fast_heartbeats.xml makes them faster"
        )
        yield Fault(_burst(each.name, each), check, input=index, explains=False)


def _burst(names: str, *held_up: InputFacts) -> str:
    count = max(each.figures.bursts for each in held_up)
    times = "once" if count == 1 else f"{count} times"
    held = words.duration(max(each.figures.held for each in held_up))
    return f"messages of {names} arrived in a burst {times} in the last 10 s, up to {held} late"


def _overlap(held_up: Sequence[Sequence[tuple[int, int]]]) -> bool:
    """Whether each of these was held up at a time at which the first was."""
    first, *others = held_up
    return all(
        any(begin < other_end and other_begin < end for begin, end in first for other_begin, other_end in other)
        for other in others
    )


def messages_lost(facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find messages that were published and did not come here: by their numbers, or else as DDS reports it."""
    graph, share = an_input.graph, facts.figures.share
    losing = [each for each in graph.senders if each.lost]
    if not losing and not graph.undelivered:
        return
    # Each cost a set at most: they are the cause where they account for most of those that are missing.
    missing, cost = share.possible - share.left, sum(each.graph.undelivered for each in facts.inputs if each.required)
    explains = an_input.required and 0 < missing <= 2 * cost
    if losing:
        lost = " and ".join(f"{each.lost} of {each.sent} messages from {each.node}" for each in losing)
        why, cure = _why_lost(graph, losing)
        yield Fault(f"{lost} did not arrive on {an_input.name} in the last 10 s: {why}", cure, explains=explains)
    else:
        messages = "1 message" if graph.lost == 1 else f"{graph.lost} messages"
        yield Fault(
            f"DDS lost {messages} of {an_input.name} on the way here in the last 10 s",
            f"{_CHECK_NETWORK}; if {nodes(an_input)} is reliable, `qos: auto` makes it resend them",
            explains=explains,
        )


def _why_lost(graph: InputGraph, losing: Sequence[Sender]) -> tuple[str, str]:
    """Say why messages did not arrive, as far as it is known, and what to do."""
    names, profile = " and ".join(each.node for each in losing), graph.profile
    # DDS reports what it lost on the way, and not what a full history gave up for newer messages: those came.
    came = sum(each.delivered for each in graph.senders)
    if (
        profile is not None
        and profile.history == "keep_last"
        and 2 * graph.lost < graph.undelivered
        and came >= profile.depth
    ):
        depth = min(_MOST_KEPT, profile.depth + sum(each.longest_gap for each in losing))
        return (
            f"newer ones replaced them in the relay's subscription, whose `depth` of {profile.depth} was too small",
            f"`depth: {depth}` in the `qos` of {graph.name} holds as many as came at once",
        )
    if profile is not None and profile.reliability == "best_effort":
        return (
            "they were sent by best effort and lost on the way",
            f"{_CHECK_NETWORK}; if {names} can publish as reliable, `qos: auto` has lost messages sent again",
        )
    others = f"whether another subscriber of {graph.name} hangs, which holds up all"
    return (
        f"they were lost on the way, and {names} no longer had them to send them again",
        f"{_CHECK_NETWORK}, and {others}; with a larger `depth`, {names} can send more of them again",
    )


def too_slow(facts: GroupFacts) -> Found:
    """Find that messages of the group waited for the relay, or were missed while it stood still."""
    waited, missed = waited_for_relay(facts)
    if missed >= _TOO_SLOW and missed > waited:
        text = f"the relay stood still for {words.duration(max(each.ns for each in facts.standstills))}"
    elif waited >= _TOO_SLOW:
        text = f"messages waited up to {words.duration(waited)} for the relay"
    else:
        return
    yield Fault(
        text,
        "check whether other processes leave it enough CPU; if they do, spread the groups over several relays with"
        " --group",
    )


def waited_for_relay(facts: GroupFacts) -> tuple[int, int]:
    """Return for how long messages waited for the relay, and for how long none came as it stood still."""
    held_up = _overlapped(facts, [each.figures.held_up for each in facts.inputs])
    return max(facts.waited, held_up), _overlapped(facts, [_pauses(facts, each) for each in facts.inputs])


def stood_still_until(facts: GroupFacts) -> int | None:
    """Return until when the relay last stood still. None where it did not."""
    return max((each.until for each in facts.standstills if each.ns >= _TOO_SLOW), default=None)


def _overlapped(facts: GroupFacts, inputs: Iterable[Iterable[tuple[int, int]]]) -> int:
    """Return for how long of a standstill an input was held up. A standstill alone has kept nothing waiting."""
    long = [each for each in facts.standstills if each.ns >= _TOO_SLOW]
    if not long:
        return 0
    held_up = [span for each in inputs for span in each]
    return max((each.overlap(begin, end) for each in long for begin, end in held_up), default=0)


def _pauses(facts: GroupFacts, an_input: InputFacts) -> Iterator[tuple[int, int]]:
    """Yield when an input paused for longer than its rate explains."""
    now, figures = facts.figures.now, an_input.figures
    usual = round(SECOND / figures.usual_hz) if figures.usual_hz else max(SECOND, median_low(figures.gaps or (0,)))
    longest = _PAUSE_PERIODS * usual
    yield from ((one, other) for one, other in pairwise(figures.received) if other - one > longest)
    if (last := figures.last_received) is not None and any(
        each.earliest - longest <= last <= each.until < now <= each.until + SENT_AGAIN for each in facts.standstills
    ):
        yield last, now


def paused(facts: GroupFacts) -> Found:
    """Find that somebody has paused the relay. A warning: it is as it was asked for, and may be forgotten."""
    if facts.pause is not None:
        since = words.seconds(facts.figures.now - min(facts.pause.since, facts.figures.now))
        yield Fault(
            f"paused for {since}: no set leaves",
            f"`ros2 service call {facts.pause.ended_by} std_srvs/srv/Trigger` ends the pause",
        )


def slowed(_facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find an input that comes at a much lower rate than it used to, unless it was sent at the same and then lost."""
    figures, sent_hz = an_input.figures, an_input.graph.sent_hz
    if figures.slowed_from_hz is None:
        return
    if not an_input.graph.undelivered or sent_hz is None or sent_hz < RECOVERED * figures.slowed_from_hz:
        yield Fault(
            f"{an_input.name} has slowed from {words.rate(figures.slowed_from_hz)} to {words.rate(figures.pace_hz)}",
            f"check {nodes(an_input)}: its settings, its load, and the network to it",
        )


def fates(an_input: InputFacts) -> str:
    """Say what most often became of an input's messages."""
    figures = an_input.figures
    if not figures.fed:
        return f"no messages of {an_input.name} arrived recently"
    dropped = sorted(figures.dropped.items(), key=lambda item: -item[1])[:2]
    parts = " and ".join(f"{count} were dropped as {reason.value}" for reason, count in dropped)
    return f"of the last {figures.fed} messages of {an_input.name}, {parts or 'none were dropped'}"
