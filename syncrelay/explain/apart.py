"""How far apart the stamps of two inputs usually are: which input is off, and which tolerances are too narrow."""

from itertools import combinations
from typing import Final

import numpy as np

from syncrelay.explain import words
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.nearest import Nanoseconds, quantile, shifted, signed_distances
from syncrelay.explain.standing import FEW

# Of fewer messages nothing is usual.
_FEWEST: Final = 3


def who_is_off(facts: GroupFacts) -> str | None:
    """Say which input lies off all others, which lie near each other, or which two are far apart; None of neither."""
    tolerance, required = facts.tolerance, [index for index, each in enumerate(facts.inputs) if each.required]
    if tolerance is None or len(required) < 3:  # noqa: PLR2004  of two, either may be
        return None
    far = []
    for pair in combinations(required, 2):
        distance = _usually_apart(*(facts.inputs[index] for index in pair))
        if distance is None:
            return None
        if distance > tolerance.ns:
            far.append(pair)
    if len(far) == 1:
        one, other = (facts.inputs[index].name for index in far[0])
        return f"{one} and {other} are far from each other"
    odd = set.intersection(*map(set, far)) if len(far) == len(required) - 1 else set()
    return f"it is {facts.inputs[odd.pop()].name} that is off, the others are near each other" if odd else None


def over_tolerances(facts: GroupFacts, index: int | None = None) -> str | None:
    """Say which two inputs, of `index` and one that is required, slop often allows and a tolerance does not.

    Without `index`, both are required. None if there are no such two.
    """
    if facts.tolerance is None:
        return None
    slop, required = facts.tolerance.ns, [each for each in facts.inputs if each.required]
    pairs = combinations(required, 2) if index is None else ((facts.inputs[index], each) for each in required)
    for pair in pairs:
        distances = np.abs(_distances(*pair))
        # Of two inputs without a tolerance, this is twice slop: nothing is over it.
        twice = sum(slop if each.narrowed is None else min(2 * each.narrowed.ns, slop) for each in pair)
        over = distances[(2 * distances > twice) & (distances <= slop)]
        if len(distances) >= _FEWEST and len(over) > (1 - FEW) * len(distances):
            halves = (
                f"half of {facts.tolerance.key} {words.duration(slop)}"
                if each.narrowed is None
                else f"{each.narrowed.key} {words.duration(each.narrowed.ns)} of {each.name}"
                for each in pair
            )
            names = " and ".join(each.name for each in pair)
            usual, limit = quantile(np.sort(distances), 0.5), f"over {' plus '.join(halves)}"
            if 2 * usual > twice:
                return f"stamps of {names} are usually {words.duration(usual)} apart, {limit}"
            share, most = words.share(len(over) / len(distances)), words.duration(int(over.max()))
            return f"in {share} of messages, stamps of {names} are up to {most} apart, {limit}"
    return None


def _usually_apart(*two: InputFacts) -> int | None:
    """Return how far apart the stamps of two inputs usually are, in nanoseconds; None if too few have come to tell."""
    distances = _distances(*two)
    return None if len(distances) < _FEWEST else abs(quantile(distances, 0.5))


def _distances(*two: InputFacts) -> Nanoseconds:
    stamps = (np.sort(shifted(np.array(each.figures.stamps, dtype=np.int64), each.offset)) for each in two)
    return signed_distances(*sorted(stamps, key=len))
