"""Two faults, of which the one that was named is mended: whether the other is named once that is done."""

import random
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from syncrelay.explain import Code, Finding, GroupFacts, Severity, explanation
from tests.bank.kinds import Truth
from tests.bank.play import IN_TIME_S, MIDWAY_S, Drawn, Result, Score, fit, heard, is_of_rig
from tests.bank.rig import LONGEST_S, Flow, Rig, S, spans

# What is mended in the file begins anew, as a draw with the other fault alone.
_OF_FILE: Final = frozenset({"narrow_slop", "low_max_age", "short_queue", "optional_away"})
# They are over, and cannot be told for long.
_EVENTS: Final = frozenset({"stalls", "all_held"})
# Of these, what was before has to be known.
_CHANGES: Final = frozenset({"slowed", "step", "two_steps", "restart_at_0"})
# Stamps that were set are off from then on.
_OFF: Final = frozenset({"over_slop", "constant_offset", "other_clock"})
_STEPS: Final = frozenset({"step", "two_steps", "restart_at_0"})
# A clock that is put right is one that is set, and is told for so long.
_OF_CLOCK: Final = frozenset({Code.CLOCK_STEP, Code.TIME_JUMP})
_STEP_TOLD_S: Final = 30.0
_AFTER_S: Final = (0.5, 5.0)


@dataclass
class Mended:
    """When which fault was mended, and what was said first of the other."""

    draw: Drawn
    at: float
    kind: str
    result: Result

    @property
    def why(self) -> str:
        """What was said in place of the other fault."""
        first = self.result.first
        return f"{self.kind} mended: {self.result.why or (first[1].code.value if first else '')}"


def mended(draw: Drawn, result: Result) -> Mended | None:
    """Mend the fault that was named, a while after it was, and play on; None where that shows nothing of the other."""
    if not draw.alone or result.first is None or not result.is_told:
        return None
    named = next(at for at, truth in enumerate(draw.truths) if fit(draw, truth, *result.first)[0] is result.score)
    kind, other = draw.kinds[named], draw.kinds[1 - named]
    at = result.first[0] + random.Random(f"mended {draw.seed}").uniform(*_AFTER_S)
    truth = _truth_after(draw, named, at)
    if kind in _OF_FILE or truth is None or truth.seen + IN_TIME_S > LONGEST_S:
        return None
    after = replace(
        draw,
        rig=_mended_at(draw.rig, draw.alone[1 - named].rig, at),
        truths=(truth,),
        kinds=(other,) if kind != "stalls" else draw.kinds,
        seconds=truth.seen + IN_TIME_S,
        looks=[n * 1.03 + draw.looks[0] for n in range(round((truth.seen + IN_TIME_S) / 1.03))],
    )
    mend = draw.truths[named]

    def is_passed_over(finding: Finding, now: int) -> bool:
        second = (now - draw.rig.began) / S
        if finding.severity is Severity.OK or second < at:
            return True
        fits = fit(after, truth, second, finding)[0]
        if fits in (Score.TOLD, Score.LATE):
            return False
        if is_of_rig(after, finding, second) or fit(draw, mend, second, finding)[0] in (Score.TOLD, Score.LATE):
            return True
        topics = {draw.config.topics[index].topic for index in finding.about}
        # What is left of the first fault may be said, as long as the other is named too.
        is_left_over = finding.code.value in mend.codes
        is_of_mend = finding.code in _OF_CLOCK and second < at + _STEP_TOLD_S
        return (is_left_over and not topics) or (bool(topics & mend.topics) and (is_left_over or is_of_mend))

    def chosen(facts: GroupFacts, found: tuple[Finding, ...]) -> Finding | None:
        left = tuple(each for each in found if not is_passed_over(each, facts.figures.now))
        return explanation(left) if left else None

    after_it = heard(after, chosen)
    after_it.judge()
    return Mended(draw, at, kind, after_it)


def _truth_after(draw: Drawn, named: int, at: float) -> Truth | None:
    """Return what is true of the other fault once one is mended; None where it is over, or cannot be seen then."""
    (rig, truth), other = draw.alone[1 - named], draw.kinds[1 - named]
    # What changes is drawn so late that it is known what was before: here, since the first fault is mended.
    was_known = other not in _CHANGES or not truth.topics & draw.truths[named].topics
    if rig.begin >= at + (0 if was_known else MIDWAY_S[0] + 8 * rig.slowest / S):
        return truth
    if not was_known or other in _EVENTS or (other in _STEPS and not _shows(rig)):
        return None
    takes = truth.seen - (rig.begin or rig.starts)
    codes = truth.codes | _OFF if other in _STEPS else truth.codes
    after = replace(truth, codes=codes, seen=max(truth.seen, at + takes))
    if truth.unit == "share":
        # What is lost by chance is told of the messages that are seen by then.
        (topic,) = truth.topics
        came, sent = (_count(each, topic, max(at, rig.begin), after.seen) for each in (rig, draw.well))
        after = replace(after, sizes=(1 - came / max(1, sent),))
    return after


def _count(rig: Rig, topic: str, begin: float, end: float) -> int:
    return sum(int(np.sum(each.since(begin) & ~each.since(end))) for each in rig.flows if each.topic == topic)


def _shows(rig: Rig) -> bool:
    """Whether stamps that were set are too far from the others' from then on, and not as near to other messages."""
    after = spans(rig, [replace(each, stamps=each.stamps[each.since(rig.begin)]) for each in rig.flows])
    return not len(after) or float(np.mean(after > rig.slop)) > 0.95


def _mended_at(both: Rig, alone: Rig, at: float) -> Rig:
    """Return a rig that has both faults until a second, and one from then on."""
    before = [replace(each, shown=_until(each, at)) for each in both.flows]
    after = [replace(each, shown=_from(each, at)) for each in alone.flows]
    for each in before:
        each.keep(~each.since(at))
    for each in after:
        each.keep(each.since(at))
        # One publisher sends in order, and what was held up is sent first.
        sent = [int(of.received.max()) for of in before if of.endpoint.node == each.endpoint.node and len(of.received)]
        each.received = np.maximum(each.received, max(sent, default=0))
    return replace(both, flows=[*before, *after])


def _until(flow: Flow, at: float):
    return lambda second: second < at and flow.shown(second)


def _from(flow: Flow, at: float):
    return lambda second: second >= at and flow.shown(second)
