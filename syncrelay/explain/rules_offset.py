"""The finding that stamps of an input are off by a constant, so that sets hold messages of different moments."""

from typing import Final

import numpy as np

from syncrelay.explain import words
from syncrelay.explain.codes import Code
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.findings import SECOND, Fault, Found, nodes
from syncrelay.explain.nearest import quantile, shifted, signed_distances
from syncrelay.explain.rows import blocks, quantiles
from syncrelay.explain.rules_stamps import offered_offset, other_clock

# Stamps a constant distance apart may pair wrong messages: at least this many, at least this share of a period apart,
# of rates that differ by no more than this share, scattering by no more than this share of a period, and within this
# share of a whole number of periods by their times of receipt: the greater where stamps are ahead of their time, as it
# is certain then that they are off.
ENOUGH: Final = 20
_OFF: Final = 0.15
_SAME_RATE: Final = 0.05
_SCATTERS: Final = 0.25
_WHOLE: Final = 0.1
_WHOLE_AHEAD: Final = 0.3
_AHEAD: Final = 0.25
_OTHER_CLOCK: Final = SECOND


def constant_offset(facts: GroupFacts) -> Found:
    """Find an input whose stamps lie a constant distance off, so that messages of different moments are paired.

    Of two inputs of one rate, the messages that are nearest by their stamps come whole periods apart: those that come
    together were made together. A delay alone does not show here, as it leaves the right stamps near each other.
    """
    if not facts.by_stamp or any(map(facts.is_held, range(len(facts.inputs)))) or next(other_clock(facts), None):
        return
    first, *others = [index for index, each in enumerate(facts.inputs) if each.required]
    for other in others:
        if (off := _whole_periods_off(facts, first, other)) is None:
            continue
        # The one that is farther from this machine's time is odd.
        odd, right = sorted((first, other), key=lambda index: -abs(_late_by(facts.inputs[index])))
        off = off if odd == other else -off
        name = facts.inputs[odd].name
        advice = offered_offset(facts, Code.CONSTANT_OFFSET, odd, facts.inputs[odd].offset - off)
        yield Fault(
            f"stamps of {name} are always {words.behind(-off)} those of {facts.inputs[right].name} received at the"
            " same time: sets may hold messages of different moments",
            f"check how {nodes(facts.inputs[odd])} stamps"
            + (f"; if both are measured at the same time, {advice}" if advice else ""),
            input=odd,
        )


def _whole_periods_off(facts: GroupFacts, first: int, other: int) -> int | None:
    """Return how far the stamps of `other` are ahead of those of `first` that come with them, None if all is well."""
    one, two = facts.inputs[first], facts.inputs[other]
    if not one.figures.delays or not two.figures.delays or not two.figures.pace_hz:
        return None
    later = two.figures.delays[-1] - two.offset - one.figures.delays[-1] + one.offset
    period = SECOND / two.figures.pace_hz
    is_same_rate = abs(one.figures.pace_hz * period / SECOND - 1) <= _SAME_RATE
    if abs(later) < period / 2 or abs(later) > _OTHER_CLOCK or not is_same_rate:
        # As nearly always, and seen without measuring.
        return None
    stamps = (shifted(np.array(each.figures.stamps, dtype=np.int64), each.offset) for each in (one, two))
    signed = signed_distances(*map(np.sort, stamps))
    if len(signed) < ENOUGH:
        return None
    # Amid two messages, now the one is nearest and now the other, a period apart: of these, the usual one counts.
    usual = quantile(signed, 0.5)
    signed -= (np.round((signed - usual) / period) * period).astype(np.int64)
    low, distance, high = quantiles(lambda: blocks(signed), [0.05, 0.5, 0.95])
    if high - low > _SCATTERS * period:
        return None
    delays = _late_by(one), _late_by(two)
    apart = distance + delays[1] - delays[0]
    whole = round(apart / period)
    # Results that take long have the stamps of what they are of. None is stamped before its time, but a simulated clock
    # comes in ticks, and is up to one behind.
    is_ahead = facts.clock is None and max(delays, key=abs) <= -_AHEAD * period
    may_be_result = not is_ahead and abs(distance) < _OFF * period
    near = _WHOLE_AHEAD if is_ahead else _WHOLE
    if not whole or may_be_result or abs(apart - whole * period) > near * period:
        return None
    return round(distance - whole * period)


def _late_by(an_input: InputFacts) -> int:
    """Return how long after its stamp, offset added, a message usually comes."""
    return (an_input.figures.delay or 0) - an_input.offset
