"""What is to be waited for, where more will be known soon of why something is so."""

from typing import Final

from syncrelay.explain.codes import Code
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.rules_drift import may_drift
from syncrelay.explain.rules_matching import is_overdue

# What a clock brings about, and sooner than it can be proven that it drifts, or was set.
_OF_DRIFT: Final = frozenset({Code.OVER_SLOP, Code.CONSTANT_OFFSET, Code.FEW_SETS, Code.UNEXPLAINED})
_OF_STEP: Final = _OF_DRIFT | {Code.SHORT_QUEUE, Code.OUT_OF_ORDER, Code.CLOCK_DRIFT, Code.OTHER_CLOCK}
# What an input brings about that has slowed down or ceased to come.
_OF_PACE: Final = frozenset({Code.OVER_SLOP, Code.SHORT_QUEUE, Code.FEW_SETS, Code.UNEXPLAINED})
# So many messages, over so long, show of which unit stamps are, and at which rate they run.
_FEWEST: Final = 5
_YOUNG: Final = 1_200_000_000


def _is_young(an_input: InputFacts) -> bool:
    figures, received = an_input.figures, an_input.figures.received
    if not received:
        return False
    # Of a fast input, as many messages as are kept span less than that however long they have come. There are fewer
    # stamps where they were not set, or were of another clock, before.
    since = min(received[0], figures.flows_since or received[0])
    if 0 < len(figures.stamps) < len(received):
        since = figures.stamps[0] + figures.delays[0]
    return len(received) < _FEWEST or received[-1] - since < _YOUNG


def known_soon(facts: GroupFacts, code: Code) -> str:
    """Say what is to be waited for, where more will be known soon of what brings a finding of this code about."""
    what = ""
    if code in _OF_STEP and facts.by_stamp and any(each.figures.may_step for each in facts.inputs):
        what = "a clock was set"
    elif code is Code.OTHER_CLOCK and not facts.is_silent and any(_is_young(each) for each in facts.inputs):
        what = "its stamps are of another unit or rate"
    elif code in _OF_PACE and (slower := next((each for each in facts.inputs if each.figures.may_be_slower), None)):
        what = f"{slower.name} has slowed down"
    elif code in _OF_PACE and not facts.is_silent and (away := is_overdue(facts)) is not None:
        what = f"{away.name} has ceased to come"
    elif code in _OF_DRIFT and may_drift(facts):
        what = "a clock drifts"
    return f"wait some seconds: it is not known yet whether {what}" if what else ""
