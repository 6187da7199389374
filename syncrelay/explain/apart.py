"""How far apart the stamps of two inputs usually are: which input is off, and which tolerances are too narrow."""

from collections.abc import Iterator
from itertools import combinations
from typing import Final

import numpy as np

from syncrelay.config.units import parse_duration
from syncrelay.explain import words
from syncrelay.explain.changes import Change, Changes
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.nearest import Nanoseconds, quantile, shifted, signed_distances
from syncrelay.explain.standing import FEW
from syncrelay.explain.widths import with_headroom

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
    slop = facts.tolerance.ns
    for pair in (tuple(facts.inputs[at] for at in each) for each in _narrowed_pairs(facts, index)):
        distances = np.abs(_distances(*pair))
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


def wider_tolerances(facts: GroupFacts, index: int | None = None) -> Changes:
    """Return tolerances that do not keep apart what slop allows, of the same inputs; no wider than half of slop."""
    widest = facts.tolerance.ns // 2 if facts.tolerance is not None else 0
    before = {at: min(each.narrowed.ns, widest) for at, each in enumerate(facts.inputs) if each.narrowed is not None}
    wider = dict(before)
    for pair in _narrowed_pairs(facts, index):
        distances = np.sort(np.abs(_distances(*(facts.inputs[at] for at in pair))))
        near = distances[distances <= 2 * widest]
        if len(near) < _FEWEST:
            continue
        needed = min(2 * widest, parse_duration(with_headroom(near)))
        # What was widened for another pair already first, then the narrowest.
        for at in sorted(set(pair) & {*wider}, key=lambda at: (wider[at] == before[at], before[at])):
            lacks = needed - sum(wider.get(each, widest) for each in pair)
            wider[at] = min(widest, wider[at] + max(0, lacks))
    return tuple(
        Change("tolerance", words.at_least(value), at) for at, value in sorted(wider.items()) if value > before[at]
    )


def _narrowed_pairs(facts: GroupFacts, index: int | None) -> Iterator[tuple[int, int]]:
    """Yield pairs of required inputs, or of `index` and one of them, of which one at least has a tolerance."""
    required = [at for at, each in enumerate(facts.inputs) if each.required]
    for one, other in combinations(required, 2) if index is None else ((index, each) for each in required):
        if facts.inputs[one].narrowed is not None or facts.inputs[other].narrowed is not None:
            yield one, other


def _usually_apart(*two: InputFacts) -> int | None:
    """Return how far apart the stamps of two inputs usually are, in nanoseconds; None if too few have come to tell."""
    distances = _distances(*two)
    return None if len(distances) < _FEWEST else abs(quantile(distances, 0.5))


def _distances(*two: InputFacts) -> Nanoseconds:
    stamps = (np.sort(shifted(np.array(each.figures.stamps, dtype=np.int64), each.offset)) for each in two)
    return signed_distances(*sorted(stamps, key=len))
