"""Which findings explain which others, since when what each judges by was seen, and until when a cause had effects."""

from collections.abc import Callable, Mapping
from math import inf
from typing import Final, NamedTuple

from syncrelay.explain import rules_flow, rules_matching, rules_offset, rules_stamps
from syncrelay.explain.codes import MATCHING, Code, Of, codes_of
from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.findings import SECOND, Finding
from syncrelay.explain.order import WINDOW_NS
from syncrelay.sync.messages import DropReason

# A cause is seen to be over at the next look. By then, what it has left in queues is gone.
SETTLES: Final = round(1.1 * SECOND)
# So many messages in a row without a fault show that it is over.
_NO_MORE: Final = 3


class Explained(NamedTuple):
    """What a finding explains: in the whole group, and only where it is about the same input."""

    in_group: frozenset[Code]
    of_input: frozenset[Code] = frozenset()


_ORDER: Final = codes_of(Of.ORDER)
_FLOW: Final = codes_of(Of.MESSAGES, Of.ORDER, Of.MATCHING) | {Code.NO_CLOCK}
"""What messages tell, and not the graph."""

_COUNTED: Final = {
    Code.MALFORMED: DropReason.MALFORMED,
    Code.UNSTAMPED: DropReason.UNSTAMPED,
    Code.DUPLICATES: DropReason.DUPLICATE,
}
_OF_ONE_MOMENT: Final = frozenset({Code.OUT_OF_ORDER, Code.DUPLICATES, Code.BURSTS})
OF_CLOCKS: Final = frozenset({Code.OTHER_CLOCK, Code.CLOCK_STEP, Code.CLOCK_DRIFT})

# What can be mended before the node is activated.
_SAID_OF_THE_INACTIVE: Final = frozenset(
    {Code.INTERNAL_ERROR, Code.INACTIVE, Code.TYPE_NOT_IMPORTABLE, Code.OTHER_TYPE, Code.SEVERAL_TYPES}
)

EXPLAINS: Final[Mapping[Code, Explained]] = {
    Code.INTERNAL_ERROR: Explained(MATCHING),
    # Stamps that are not set are seen by what the policy drops for them.
    Code.PAUSED: Explained(MATCHING | {Code.UNSTAMPED}),
    Code.INACTIVE: Explained(frozenset(Code) - _SAID_OF_THE_INACTIVE),
    Code.ALONE: Explained(MATCHING | {Code.NO_PUBLISHER, Code.NO_CLOCK}),
    Code.NO_PUBLISHER: Explained(MATCHING),
    Code.TYPE_NOT_IMPORTABLE: Explained(MATCHING),
    Code.OTHER_TYPE: Explained(MATCHING),
    Code.SEVERAL_TYPES: Explained(MATCHING),
    Code.INCOMPATIBLE_QOS: Explained(MATCHING),
    Code.NOBODY_LISTENS: Explained(_FLOW),
    Code.NO_CLOCK: Explained(frozenset({Code.SILENT, Code.WAITING_FOR_OPTIONAL, Code.FEW_SETS, Code.UNEXPLAINED})),
    Code.CLOCK_STOPPED: Explained(MATCHING | {Code.SILENT, Code.SLOWED}),
    Code.TOO_SLOW: Explained(
        MATCHING | {Code.SILENT, Code.BURSTS, Code.MESSAGES_LOST, Code.CLOCK_DRIFT, Code.CLOCK_STEP}
    ),
    Code.SILENT: Explained(MATCHING),
    Code.MALFORMED: Explained(MATCHING),
    Code.UNSTAMPED: Explained(MATCHING),
    Code.SEVERAL_PUBLISHERS: Explained(
        MATCHING | {Code.OTHER_CLOCK}, _ORDER | {Code.CLOCK_STEP, Code.CLOCK_DRIFT, Code.SLOWED, Code.BURSTS}
    ),
    Code.TIME_JUMP: Explained(
        MATCHING | {Code.OTHER_CLOCK},
        frozenset({Code.OUT_OF_ORDER, Code.DUPLICATES, Code.CLOCK_DRIFT, Code.SLOWED, Code.BURSTS}),
    ),
    Code.CLOCK_STEP: Explained(MATCHING | {Code.OTHER_CLOCK, Code.CLOCK_DRIFT}, _ORDER | {Code.BURSTS}),
    Code.CLOCK_DRIFT: Explained(MATCHING | {Code.OTHER_CLOCK}),
    Code.OTHER_CLOCK: Explained(MATCHING, frozenset({Code.DUPLICATES, Code.OUT_OF_ORDER, Code.SLOWED, Code.BURSTS})),
    Code.SLOWED: Explained(MATCHING),
    Code.BURSTS: Explained(frozenset({Code.SHORT_QUEUE, Code.FEW_SETS, Code.UNEXPLAINED})),
    Code.MESSAGES_LOST: Explained(
        frozenset({Code.OVER_SLOP, Code.FEW_SETS, Code.UNEXPLAINED}), frozenset({Code.BURSTS})
    ),
    Code.OUT_OF_ORDER: Explained(frozenset({Code.OVER_SLOP, Code.FEW_SETS, Code.UNEXPLAINED})),
    Code.DUPLICATES: Explained(
        frozenset({Code.OVER_SLOP, Code.SHORT_QUEUE, Code.CONSTANT_OFFSET, Code.FEW_SETS, Code.UNEXPLAINED})
    ),
    Code.OVER_SLOP: Explained(frozenset({Code.FEW_SETS, Code.UNEXPLAINED})),
}
"""Causes, and which other findings they explain. No chain of explanations comes back to where it began."""


def explained_by(code: Code) -> frozenset[Code]:
    """Return what a finding of this code may explain."""
    explained = EXPLAINS.get(code)
    return explained.in_group | explained.of_input if explained else frozenset()


def _first_step(facts: GroupFacts) -> int:
    steps = (each.figures.stepped for each in facts.inputs)
    told = (step.at for step in steps if step and rules_stamps.is_told(facts, step))
    return min(told, default=facts.figures.now)


def _faulty_since(facts: GroupFacts) -> int:
    known = (each.figures.faulty_since for each in facts.inputs)
    return max((at for at in known if at is not None), default=facts.figures.now - WINDOW_NS)


def _apart_since(facts: GroupFacts) -> int:
    if facts.ticks_hz is None:
        return facts.figures.nearest_from
    # At ticks, what is too old is seen by how late messages come.
    came = (each.figures.received[-len(each.figures.delays) :] for each in facts.inputs if each.figures.delays)
    return min((received[0] for received in came if received), default=facts.figures.now)


SEEN_SINCE: Final[Mapping[Code, Callable[[GroupFacts], int]]] = {
    # That an input is silent is seen of now alone.
    Code.SILENT: lambda facts: facts.figures.now,
    # What the graph shows, it shows of now.
    Code.NO_PUBLISHER: lambda facts: facts.figures.now,
    Code.NO_CLOCK: lambda facts: facts.figures.now,
    Code.OUT_OF_ORDER: _faulty_since,
    Code.DUPLICATES: _faulty_since,
    Code.OVER_SLOP: _apart_since,
    Code.CONSTANT_OFFSET: lambda facts: min(
        (each.figures.received[-rules_offset.ENOUGH :][0] for each in facts.inputs if each.figures.received),
        default=facts.figures.now,
    ),
    Code.CLOCK_STEP: _first_step,
    Code.BURSTS: lambda facts: max(
        (begin for each in facts.inputs for begin, _ in each.figures.held_up), default=facts.figures.now
    ),
    Code.FEW_SETS: lambda facts: facts.figures.now - facts.figures.share.ns,
}
"""Since when the messages came that a finding judges by, where that is not the usual window."""


class Cause(NamedTuple):
    """A cause, when it was last found, when it ended, and whether it was said then: nothing else explained it."""

    finding: Finding
    at: int
    ended: int
    most: float = inf
    """How many sets it may have cost."""
    set_at: int | None = None
    """When the clock was set, if that is the cause: stamps are off from then on, but fell or came at once only then."""
    was_said: bool = False
    is_aside: bool = False
    """Whether it is about an optional input, and no reason for what befalls the others."""


def is_aside(finding: Finding, facts: GroupFacts) -> bool:
    """Whether a finding is about an optional input alone."""
    if finding.input is None or facts.inputs[finding.input].required:
        return False
    # An optional input whose stamps jump back and forth restarts the matching of all.
    return not rules_stamps.swings(facts.inputs[finding.input])


def set_at(finding: Finding, facts: GroupFacts) -> int | None:
    """Return when the clock of an input was set, of a finding that says so."""
    if finding.code is not Code.CLOCK_STEP or finding.input is None:
        return None
    step = facts.inputs[finding.input].figures.stepped
    return None if step is None else step.at


def may_cost(cause: Cause, code: Code, facts: GroupFacts) -> bool:
    """Whether a cause can have an effect of a code: of what a relay that stood still lost, some find their partners."""
    return not (cause.finding.code is Code.TOO_SLOW and code is Code.OVER_SLOP and rules_matching.none_is_near(facts))


def outlasts(finding: Finding, cause: Cause, facts: GroupFacts) -> bool:
    """Whether an input has been silent after a relay that stood still got again what it had missed."""
    if finding.code is not Code.SILENT or cause.finding.code is not Code.TOO_SLOW:
        return False
    last = max(facts.inputs[index].figures.last_received or 0 for index in finding.about)
    return facts.figures.now - last > max(rules_flow.waited_for_relay(facts)) + rules_flow.SENT_AGAIN


def most_missed(finding: Finding, facts: GroupFacts) -> float:
    """Return how many sets a cause may have cost where it was short: twice those of its time and of a second."""
    lasted = max(rules_flow.waited_for_relay(facts)) / SECOND + 1
    return 2 * (1 + lasted * facts.possible_hz) if finding.code is Code.TOO_SLOW else inf


def effects_until(cause: Cause, code: Code) -> int:
    """Return until when a cause had effects of a code."""
    if cause.set_at is not None and code in _OF_ONE_MOMENT:
        return cause.set_at
    # What is sent again after a standstill comes late once, which makes no step.
    lasts = cause.finding.code is Code.TOO_SLOW and cause.ended < cause.at and code is not Code.CLOCK_STEP
    return cause.ended + rules_flow.SENT_AGAIN if lasts else cause.ended


def over_since(cause: Cause, facts: GroupFacts) -> int:
    """Return since when a cause can have had no more effect: its inputs flow, and are stamped as they are now."""
    about = [facts.inputs[index].figures for index in cause.finding.about]
    return max([effects_until(cause, Code.FEW_SETS), *(max(each.flows_since or 0, each.changed_at) for each in about)])


def ended(finding: Finding, facts: GroupFacts) -> int:
    """Return until when a cause that is found now held. What is counted is found for as long as it is counted."""
    now = facts.figures.now
    if finding.code is Code.TOO_SLOW:
        return min(now, rules_flow.stood_still_until(facts) or now)
    if finding.code is Code.BURSTS:
        return max((until for at in finding.about for _, until in facts.inputs[at].figures.held_up), default=now)
    reason = _COUNTED.get(finding.code)
    if finding.input is None or reason is None:
        return now
    figures = facts.inputs[finding.input].figures
    last = figures.last_faults.get(reason, now)
    # Of a slow input, the next may be as bad.
    return last if (now - last) * figures.rate_hz > _NO_MORE * SECOND and now - last > SETTLES else now


def seen_since(code: Code, facts: GroupFacts) -> int:
    """Return since when the messages came that a finding of a code judges by."""
    since = SEEN_SINCE.get(code)
    return facts.figures.now - WINDOW_NS if since is None else since(facts)
